// SPDX-License-Identifier: Apache-2.0
#include "codec/video_unit.h"

#include <algorithm>
#include <optional>
#include <string>

#include "codec/byte_io.h"

namespace relievo {
namespace {

constexpr int kLeastSide = 16;
constexpr int kMostSide = 8192;
constexpr int kMostPixels = 1 << 24;
constexpr unsigned kMostReferences = 4;
constexpr unsigned kShownAsDecoded = 2;  // pic_order_cnt_type

// nal_unit_type (ITU-T H.264, Table 7-1).
enum Nal : unsigned {
  kSlice = 1,
  kIdrSlice = 5,
  kSei = 6,
  kSequence = 7,
  kPicture = 8,
  kDelimiter = 9,
  kFiller = 12
};

/// The next NAL unit of an Annex B stream, without its start code; takes it off `rest`. Empty at the end.
std::span<const std::uint8_t> next_nal(std::span<const std::uint8_t>& rest) {
  const auto start_code = [&](std::size_t from) {
    for (std::size_t i = from; i + 3 <= rest.size(); ++i)
      if (rest[i] == 0 && rest[i + 1] == 0 && rest[i + 2] == 1) return i;
    return rest.size();
  };
  const std::size_t begin = start_code(0);
  if (begin == rest.size()) return {};
  const std::size_t end = start_code(begin + 3);
  auto nal = rest.subspan(begin + 3, end - begin - 3);
  rest = rest.subspan(end);
  while (!nal.empty() && nal.back() == 0) nal = nal.first(nal.size() - 1);  // trailing_zero_8bits
  return nal;
}

/// Bits of a NAL unit's payload, most significant first, emulation prevention taken out.
class BitReader {
 public:
  explicit BitReader(std::span<const std::uint8_t> payload) {
    int zeros = 0;
    for (const std::uint8_t byte : payload) {
      if (zeros >= 2 && byte == 3) {
        zeros = 0;
        continue;
      }
      bytes_.push_back(byte);
      zeros = byte == 0 ? zeros + 1 : 0;
    }
  }

  bool ok() const { return ok_; }
  unsigned bits(int count) {
    unsigned value = 0;
    for (int i = 0; i < count; ++i) value = value << 1 | bit();
    return value;
  }
  bool flag() { return bit() != 0; }
  /// ue(v); what does not fit 31 bits is an error.
  unsigned golomb() {
    int zeros = 0;
    while (ok_ && bit() == 0) {
      if (++zeros > 30) ok_ = false;
    }
    return ok_ ? (1U << zeros) - 1 + bits(zeros) : 0;
  }

 private:
  unsigned bit() {
    if (at_ >= 8 * bytes_.size()) ok_ = false;
    if (!ok_) return 0;
    const unsigned value = bytes_[at_ / 8] >> (7 - at_ % 8) & 1U;
    ++at_;
    return value;
  }

  Bytes bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

struct Sequence {
  VideoFormat format;
  std::uint64_t coded_width = 0, coded_height = 0;  // whole macroblocks
  unsigned references = 0;
  bool progressive = false;
};

/// What a profile of the High family says before the rest. False: sampling that this format does not have.
bool read_high(BitReader& in, Sequence& sequence) {
  const unsigned chroma = in.golomb();
  const unsigned luma_bits = 8 + in.golomb();
  const unsigned chroma_bits = 8 + in.golomb();
  const bool lossless = in.flag();
  const bool scaling = in.flag();
  sequence.format.sampling = chroma == 0 ? VideoSampling::kLuma : VideoSampling::k420;
  sequence.format.bits = static_cast<int>(std::min(luma_bits, 64U));
  return chroma <= 1 && (chroma == 0 || chroma_bits == luma_bits) && !lossless && !scaling;
}

/// 7.3.2.1.1, up to the frame's cropping. Nothing: not read to there, or a kind that is not allowed.
std::optional<Sequence> read_sequence(std::span<const std::uint8_t> payload) {
  BitReader in(payload);
  Sequence sequence;
  const unsigned profile = in.bits(8);
  in.bits(16);  // constraints, level
  in.golomb();  // its number
  if (profile == 100 || profile == 110) {
    if (!read_high(in, sequence)) return std::nullopt;
  } else if (profile != 66 && profile != 77) {
    return std::nullopt;
  }
  in.golomb();  // length of picture numbers
  if (in.golomb() != kShownAsDecoded) return std::nullopt;
  sequence.references = in.golomb();
  in.flag();  // gaps in picture numbers
  sequence.coded_width = 16 * (std::uint64_t{in.golomb()} + 1);
  sequence.coded_height = 16 * (std::uint64_t{in.golomb()} + 1);
  sequence.progressive = in.flag();
  if (!sequence.progressive) return sequence;
  in.flag();  // direct_8x8_inference
  std::uint64_t cropped_width = 0;
  std::uint64_t cropped_height = 0;
  if (in.flag()) {
    const bool chroma = sequence.format.sampling == VideoSampling::k420;
    const unsigned left = in.golomb();
    const std::uint64_t right = in.golomb();
    const unsigned top = in.golomb();
    const std::uint64_t bottom = in.golomb();
    if (left != 0 || top != 0) return std::nullopt;
    cropped_width = (chroma ? 2 : 1) * right;
    cropped_height = (chroma ? 2 : 1) * bottom;
  }
  if (!in.ok() || cropped_width >= sequence.coded_width || cropped_height >= sequence.coded_height)
    return std::nullopt;
  sequence.format.width =
      static_cast<int>(std::min<std::uint64_t>(sequence.coded_width - cropped_width, 1 << 20));
  sequence.format.height =
      static_cast<int>(std::min<std::uint64_t>(sequence.coded_height - cropped_height, 1 << 20));
  return sequence;
}

Status check_sequence(std::span<const std::uint8_t> payload, const VideoFormat& format) {
  const auto sequence = read_sequence(payload);
  if (!sequence) return Error{"video has a sequence parameter set of a kind that the format does not allow"};
  const auto whole = [](int pixels) { return (static_cast<std::uint64_t>(pixels) + 15) / 16 * 16; };
  if (sequence->format != format || sequence->coded_width != whole(format.width) ||
      sequence->coded_height != whole(format.height))
    return Error{"video is " + std::to_string(sequence->format.width) + "x" +
                 std::to_string(sequence->format.height) + " with " + std::to_string(sequence->format.bits) +
                 " bits, but " + std::to_string(format.width) + "x" + std::to_string(format.height) +
                 " with " + std::to_string(format.bits) + " is declared"};
  if (!sequence->progressive || sequence->references > kMostReferences)
    return Error{"video is interlaced or keeps more than " + std::to_string(kMostReferences) +
                 " pictures, which the format does not allow"};
  return {};
}

}  // namespace

Status check_video_format(const VideoFormat& format) {
  const bool odd =
      format.sampling == VideoSampling::k420 && (format.width % 2 != 0 || format.height % 2 != 0);
  if (std::min(format.width, format.height) < kLeastSide ||
      std::max(format.width, format.height) > kMostSide || format.width * format.height > kMostPixels || odd)
    return Error{"H.264 takes pictures of " + std::to_string(kLeastSide) + " to " +
                 std::to_string(kMostSide) +
                 " pixels a side, 16.7 million in all, and even sides with colour, not " +
                 std::to_string(format.width) + "x" + std::to_string(format.height)};
  if (format.bits != 8 && format.bits != 10)
    return Error{"H.264 takes 8 or 10 bits a sample, not " + std::to_string(format.bits)};
  return {};
}

Result<bool> check_access_unit(std::span<const std::uint8_t> unit, const VideoFormat& format) {
  if (auto status = check_video_format(format); !status) return status.error();
  const auto first = std::find_if(unit.begin(), unit.end(), [](std::uint8_t byte) { return byte != 0; });
  if (first == unit.end() || *first != 1 || first - unit.begin() < 2 || first - unit.begin() > 3)
    return Error{"video does not begin with a start code"};
  int idr_slices = 0;
  int slices = 0;
  int pictures = 0;
  bool has_sequence = false;
  bool has_picture_set = false;
  while (!unit.empty()) {
    const auto nal = next_nal(unit);
    if (nal.empty()) continue;
    switch (nal[0] & 0x1f) {
      case kIdrSlice:
      case kSlice:
        ++slices;
        if ((nal[0] & 0x1f) == kIdrSlice) ++idr_slices;
        if (nal.size() > 1 && (nal[1] & 0x80) != 0) ++pictures;  // first_mb_in_slice is 0
        break;
      case kSequence:
        if (has_sequence || slices > 0) return Error{"video has parameter sets where none may be"};
        has_sequence = true;
        if (auto status = check_sequence(nal.subspan(1), format); !status) return status.error();
        break;
      case kPicture:
        if (!has_sequence || slices > 0) return Error{"video has parameter sets where none may be"};
        has_picture_set = true;
        break;
      case kSei:
      case kDelimiter:
      case kFiller:
        break;
      default:
        return Error{"video has a part of a kind that the format does not allow (NAL unit type " +
                     std::to_string(nal[0] & 0x1f) + ")"};
    }
  }
  if (pictures != 1 || (idr_slices != 0 && idr_slices != slices))
    return Error{"video does not hold exactly one picture"};
  const bool is_key = idr_slices > 0;
  if (has_sequence != is_key || has_picture_set != is_key)
    return Error{"video has no parameter sets with an IDR picture, or some with another"};
  return is_key;
}

namespace {

template <typename Wanted>
void append_nals(std::span<const std::uint8_t> unit, const Wanted& wanted, Bytes& out) {
  while (!unit.empty()) {
    const auto nal = next_nal(unit);
    if (nal.empty() || !wanted(nal[0] & 0x1fU)) continue;
    for (const std::uint8_t byte : {0, 0, 0, 1}) out.push_back(byte);
    append_bytes(out, nal);
  }
}

}  // namespace

void append_parameter_sets(std::span<const std::uint8_t> unit, Bytes& out) {
  append_nals(
      unit, [](unsigned type) { return type == kSequence || type == kPicture; }, out);
}

void append_lean_unit(std::span<const std::uint8_t> unit, Bytes& out) {
  append_nals(
      unit, [](unsigned type) { return type != kSei && type != kDelimiter && type != kFiller; }, out);
}

}  // namespace relievo
