// SPDX-License-Identifier: Apache-2.0
#include "idl/cdr.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "base/foreign_text.h"
#include "codec/byte_io.h"
#include "codec/frame3d_codec.h"

namespace relievo {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are read as little-endian");

constexpr std::size_t kEncapsulationBytes = 4;
constexpr std::uint8_t kDelimitedCdr2LittleEndian = 9;
constexpr std::size_t kMaxText = 4096;  // of a source or message: far above what anyone reads
constexpr std::uint32_t kMaxPictureSize_px = 1u << 16;
constexpr std::uint32_t kMaxColours = 8;  // primaries there are
constexpr std::uint32_t kMaxSlides = 10;
constexpr double kMostGamma = 3;  // as in rig.yaml
constexpr std::size_t kMaxStripes = 1u << 16;

// A cursor over XCDR version 2: values aligned to their size but at most to 4, relative to the first byte
// behind the encapsulation header. After a read beyond the end everything reads as zero and ok() is false.
class Cursor {
 public:
  explicit Cursor(std::span<const std::uint8_t> body) : body_(body), end_(body.size()) {}

  bool ok() const { return ok_; }
  /// The struct being read goes on.
  bool more() const { return ok_ && at_ < end_; }

  template <typename T>
  T get() {
    align(std::min<std::size_t>(sizeof(T), 4));
    T value{};
    if (!need(sizeof(T))) return value;
    std::memcpy(&value, body_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  template <std::size_t N>
  std::array<double, N> doubles() {
    std::array<double, N> values{};
    for (double& v : values) {
      v = get<double>();
      finite_ = finite_ && std::isfinite(v);
    }
    return values;
  }
  double number() { return doubles<1>()[0]; }
  /// Every double read so far was a finite number.
  bool finite() const { return finite_; }

  std::span<const std::uint8_t> bytes() {
    const auto count = get<std::uint32_t>();
    if (!need(count)) return {};
    const auto result = body_.subspan(at_, count);
    at_ += count;
    return result;
  }

  /// Text with its final NUL on the wire; control characters become '?'.
  std::string text() {
    const auto raw = bytes();
    if (raw.empty() || raw.back() != 0 || raw.size() > kMaxText) {
      ok_ = false;
      return {};
    }
    return foreign_text(std::string(raw.begin(), raw.end() - 1), kMaxText);
  }

  /// What is there from here on.
  std::span<const std::uint8_t> rest() const {
    return ok_ ? body_.subspan(at_) : std::span<const std::uint8_t>();
  }

  std::vector<std::uint32_t> numbers(std::size_t max) {
    const auto count = get<std::uint32_t>();
    if (count > max || !need(std::size_t{count} * 4)) {
      ok_ = false;
      return {};
    }
    std::vector<std::uint32_t> values(count);
    if (count > 0) std::memcpy(values.data(), body_.data() + at_, values.size() * 4);
    at_ += values.size() * 4;
    return values;
  }

  /// Reads an @appendable struct: `read` sees its members only, and what it leaves is skipped.
  template <typename Read>
  void appendable(Read read) {
    const auto length = get<std::uint32_t>();
    if (!need(length)) return;
    const std::size_t outer_end = std::exchange(end_, at_ + length);
    read();
    at_ = end_;
    end_ = outer_end;
  }

 private:
  void align(std::size_t to) {
    const std::size_t padded = (at_ + to - 1) / to * to;
    if (padded > end_) {
      ok_ = false;
    } else {
      at_ = padded;
    }
  }
  bool need(std::size_t count) {
    ok_ = ok_ && count <= end_ - at_;
    return ok_;
  }

  std::span<const std::uint8_t> body_;
  std::size_t at_ = 0;
  std::size_t end_;
  bool ok_ = true;
  bool finite_ = true;
};

std::optional<Error> bad_encapsulation(std::span<const std::uint8_t> cdr) {
  if (cdr.size() < kEncapsulationBytes) return Error{"a sample shorter than its header"};
  if (cdr[0] != 0 || cdr[1] != kDelimitedCdr2LittleEndian) {
    return Error{"a sample in an encoding other than little-endian delimited CDR 2"};
  }
  return std::nullopt;
}

Error truncated(const char* type) {
  return {std::string("a ") + type + " that ends too early or has text of a wrong form"};
}

std::optional<Error> bad_stream(const std::string& stream) {
  if (valid_stream_name(stream)) return std::nullopt;
  return Error{"a sample of a stream whose name is not of the form [A-Za-z0-9_.-]{1,64}"};
}

PinholeModel read_pinhole(Cursor& in, bool& possible) {
  PinholeModel model;
  in.appendable([&] {
    const auto width = in.get<std::uint32_t>();
    const auto height = in.get<std::uint32_t>();
    possible =
        possible && width > 0 && height > 0 && width <= kMaxPictureSize_px && height <= kMaxPictureSize_px;
    if (!possible) return;
    model.width = static_cast<int>(width);
    model.height = static_cast<int>(height);
    model.matrix = in.doubles<9>();
    model.distortion = in.doubles<5>();
  });
  return model;
}

Rig read_rig(Cursor& in, bool& possible) {
  Rig rig;
  in.appendable([&] {
    const auto scan = in.get<std::uint32_t>();
    possible = possible && scan <= 1;
    rig.scan = scan == 0 ? Scan::kInterlaced : Scan::kProgressive;
    rig.frame_rate = in.number();
    rig.camera = read_pinhole(in, possible);
    rig.projector = read_pinhole(in, possible);
    rig.projector_from_camera_rotation = in.doubles<9>();
    rig.projector_from_camera_translation = in.doubles<3>();
    rig.colour_matrix = in.doubles<9>();
    if (!in.more()) return;  // of a server that knew only the top field first
    const auto order = in.get<std::uint32_t>();
    possible = possible && order <= 1;
    rig.field_order = order == 0 ? FieldOrder::kTop : FieldOrder::kBottom;
    if (!in.more()) return;  // of a server that did not say how good its rig is
    rig.stereo_rms_px = in.number();
    rig.scale_error = in.number();
    possible = possible && rig.stereo_rms_px >= 0 && rig.scale_error >= 0;
    if (!in.more()) return;  // of a server that did not say where its camera stands
    const CameraPose pose{.rotation = in.doubles<9>(), .translation = in.doubles<3>()};
    if (std::any_of(pose.rotation.begin(), pose.rotation.end(), [](double v) { return v != 0; })) {
      possible = possible && is_rotation(pose.rotation);
      rig.world_from_camera = pose;
    }
    if (!in.more()) return;  // of a server that did not say its camera's gamma
    const double gamma = in.number();
    if (gamma == 0) return;  // as of one that passes on what it read
    possible = possible && gamma >= 1 && gamma <= kMostGamma;
    rig.camera_gamma = gamma;
  });
  return rig;
}

Pattern read_pattern(Cursor& in, bool& possible) {
  Pattern pattern;
  in.appendable([&] {
    const auto colours = in.get<std::uint32_t>();
    const auto slides = in.get<std::uint32_t>();
    const auto palette = in.bytes();
    const auto stripes = in.numbers(kMaxStripes);
    possible = possible && colours >= 2 && colours <= kMaxColours && slides >= 1 && slides <= kMaxSlides &&
               palette.size() == colours &&
               std::all_of(palette.begin(), palette.end(), [](auto c) { return c < 8; });
    if (!possible) return;
    std::uint32_t codes = 1;  // at most 8^10
    for (std::uint32_t s = 0; s < slides; ++s) codes *= colours;
    possible = std::all_of(stripes.begin(), stripes.end(), [&](auto v) {
      return v < codes && v <= static_cast<std::uint32_t>(std::numeric_limits<int>::max());
    });
    if (!possible) return;
    pattern.base = static_cast<int>(colours);
    pattern.slides = static_cast<int>(slides);
    pattern.palette.assign(palette.begin(), palette.end());
    for (const auto v : stripes) pattern.sequence.push_back(static_cast<int>(v));
    if (!in.more()) return;  // of a server that knew only complementary stripes
    const auto scheme = in.get<std::uint32_t>();
    possible = scheme <= static_cast<std::uint32_t>(Scheme::kOneSlide);
    if (possible) pattern.scheme = static_cast<Scheme>(scheme);
  });
  return pattern;
}

/// Those of a quality that this version knows.
std::vector<RungStatus> read_rungs(Cursor& in) {
  const auto kinds = in.bytes();
  std::vector<RungStatus> rungs(std::min(kinds.size(), kRungs.size()));
  const auto each = [&](auto set) {
    const auto count = in.get<std::uint32_t>();
    RungStatus unknown;
    for (std::uint32_t i = 0; i < count && in.ok(); ++i) set(i < rungs.size() ? rungs[i] : unknown);
  };
  each([&](RungStatus& rung) { rung.readers = in.get<std::uint32_t>(); });
  each([&](RungStatus& rung) { rung.frames = in.get<std::uint64_t>(); });
  each([&](RungStatus& rung) { rung.drops = in.get<std::uint64_t>(); });
  each([&](RungStatus& rung) { rung.encode_ms = in.number(); });
  each([&](RungStatus& rung) { rung.bit_rate = in.number(); });
  std::vector<RungStatus> known;
  for (std::size_t i = 0; i < rungs.size(); ++i) {
    if (kinds[i] == 0 || kinds[i] >= kRungs.size()) continue;
    rungs[i].rung = static_cast<Rung>(kinds[i]);
    known.push_back(rungs[i]);
  }
  return known;
}

}  // namespace

Result<FrameView> read_frame_cdr(std::span<const std::uint8_t> cdr) {
  if (auto bad = bad_encapsulation(cdr)) return *bad;
  Cursor in(cdr.subspan(kEncapsulationBytes));
  FrameView frame;
  in.appendable([&] {
    frame.stream = in.text();
    frame.sequence = in.get<std::uint64_t>();
    frame.number = in.get<std::uint64_t>();
    frame.capture_time_ns = in.get<std::int64_t>();
    frame.publish_time_ns = in.get<std::int64_t>();
    frame.data = in.bytes();
  });
  if (!in.ok()) return truncated("frame");
  if (auto bad = bad_stream(frame.stream)) return *bad;
  return frame;
}

bool holds_key_frame(std::span<const std::uint8_t> start_of_cdr) {
  if (bad_encapsulation(start_of_cdr)) return false;
  Cursor in(start_of_cdr.subspan(kEncapsulationBytes));
  in.get<std::uint32_t>();  // the struct's length, which reaches beyond the start
  in.text();
  for (int i = 0; i < 4; ++i) in.get<std::uint64_t>();  // numbers and times
  in.get<std::uint32_t>();                              // the frame's length
  return is_key_frame(in.rest());
}

Bytes write_frame_cdr(const FrameView& frame) {
  Bytes out{0, kDelimitedCdr2LittleEndian, 0, 0};
  append(out, std::uint32_t{0});  // the struct's length, set below
  append(out, static_cast<std::uint32_t>(frame.stream.size() + 1));
  out.insert(out.end(), frame.stream.begin(), frame.stream.end());
  out.push_back(0);
  const auto pad = [&] { out.resize((out.size() + 3) / 4 * 4); };
  pad();
  append(out, frame.sequence);
  append(out, frame.number);
  append(out, frame.capture_time_ns);
  append(out, frame.publish_time_ns);
  append(out, static_cast<std::uint32_t>(frame.data.size()));
  append_bytes(out, frame.data);
  put(out, kEncapsulationBytes, static_cast<std::uint32_t>(out.size() - kEncapsulationBytes - 4));
  const std::size_t unpadded = out.size();
  pad();
  out[3] = static_cast<std::uint8_t>(out.size() - unpadded);  // how much of it is padding
  return out;
}

Bytes write_frame_cdr(const std::string& stream, const FrameMessage& frame) {
  return write_frame_cdr(FrameView{.stream = stream,
                                   .sequence = frame.sequence,
                                   .number = frame.number,
                                   .capture_time_ns = frame.capture_time_ns,
                                   .publish_time_ns = frame.publish_time_ns,
                                   .data = *frame.data});
}

Result<StreamInfo> read_info_cdr(std::span<const std::uint8_t> cdr) {
  if (auto bad = bad_encapsulation(cdr)) return *bad;
  Cursor in(cdr.subspan(kEncapsulationBytes));
  StreamInfo info;
  bool possible = true;
  in.appendable([&] {
    info.stream = in.text();
    info.source = in.text();
    info.started_ns = in.get<std::int64_t>();
    info.rig = read_rig(in, possible);
    info.pattern = read_pattern(in, possible);
  });
  if (!in.ok()) return truncated("stream description");
  if (auto bad = bad_stream(info.stream)) return *bad;
  if (!possible || !in.finite()) return Error{"a stream description whose rig or pattern is impossible"};
  return info;
}

Result<ServerStatus> read_status_cdr(std::span<const std::uint8_t> cdr) {
  if (auto bad = bad_encapsulation(cdr)) return *bad;
  Cursor in(cdr.subspan(kEncapsulationBytes));
  ServerStatus status;
  std::uint32_t state = 0;
  in.appendable([&] {
    status.stream = in.text();
    status.time_ns = in.get<std::int64_t>();
    state = in.get<std::uint32_t>();
    status.message = in.text();
    status.frame_rate = in.number();
    status.frames_captured = in.get<std::uint64_t>();
    status.frames_published = in.get<std::uint64_t>();
    status.drops_capture = in.get<std::uint64_t>();
    status.drops_reconstruct = in.get<std::uint64_t>();
    status.drops_encode = in.get<std::uint64_t>();
    status.drops_publish = in.get<std::uint64_t>();
    status.reconstruct_ms = in.number();
    status.encode_ms = in.number();
    status.latency_ms = in.number();
    if (!in.more()) return;  // of a server that did not count them
    const auto count = in.get<std::uint32_t>();
    for (std::uint32_t i = 0; i < count && in.ok(); ++i) {
      const auto value = in.get<std::uint64_t>();
      if (i < kFilters.size()) status.filters.*kFilters[i].count = value;
    }
    if (!in.more()) return;  // of a server that did not look
    status.step.mixed = in.get<std::uint64_t>();
    status.step.regrouped = in.get<std::uint64_t>();
    for (std::optional<double>* value : {&status.step.phase, &status.step.drift_fields_s}) {
      const auto length = in.get<std::uint32_t>();
      for (std::uint32_t i = 0; i < length && in.ok(); ++i) *value = in.number();
    }
    if (!in.more()) return;  // of a server that did not count bytes
    status.bit_rate = in.number();
    status.rate_level = in.get<std::uint32_t>();
    if (!in.more()) return;  // of a server without a ladder
    status.rungs = read_rungs(in);
  });
  if (!in.ok()) return truncated("status");
  if (auto bad = bad_stream(status.stream)) return *bad;
  if (state > static_cast<std::uint32_t>(StreamState::kEnded) || !in.finite()) {
    return Error{"a status whose state or numbers are impossible"};
  }
  status.state = static_cast<StreamState>(state);
  return status;
}

}  // namespace relievo
