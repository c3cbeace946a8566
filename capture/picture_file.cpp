// SPDX-License-Identifier: Apache-2.0
#include "capture/picture_file.h"

#include <algorithm>
#include <cctype>
#include <cstring>
#include <iostream>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "base/whole_file.h"
#include "capture/picture_decode.h"
#include "capture/png_check.h"

namespace relievo {
namespace {

using Bytes = std::span<const std::uint8_t>;

/// Numbers of a file; behind its end all are 0, which is no picture's size.
class Numbers {
 public:
  Numbers(Bytes file, bool little_endian) : file_(file), little_endian_(little_endian) {}
  std::uint32_t at(std::size_t offset, std::size_t bytes) const {
    if (offset > file_.size() || file_.size() - offset < bytes) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i)
      value = value << 8 | file_[offset + (little_endian_ ? bytes - 1 - i : i)];
    return value;
  }

 private:
  Bytes file_;
  bool little_endian_;
};

constexpr std::string_view kJpeg = "\xFF\xD8\xFF";
constexpr std::string_view kPng = "\x89PNG\r\n\x1a\n";

bool begins_with(Bytes file, std::string_view magic) {
  return file.size() >= magic.size() && std::memcmp(file.data(), magic.data(), magic.size()) == 0;
}

std::uint64_t pixels(std::uint32_t width, std::uint32_t height) {
  return std::uint64_t{width} * height;
}

std::uint64_t png_pixels(Bytes file) {
  const Numbers number(file, false);
  return pixels(number.at(16, 4), number.at(20, 4));
}

/// Of the largest frame header there is: a decoder believes the one that it comes to.
std::uint64_t jpeg_pixels(Bytes file) {
  const Numbers number(file, false);
  std::uint64_t most = 0;
  for (std::size_t at = 2; at + 9 < file.size();) {
    if (file[at] != 0xFF) {
      ++at;  // entropy-coded data, or what decoders skip
      continue;
    }
    const std::uint8_t marker = file[at + 1];
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) most = std::max(most, pixels(number.at(at + 7, 2), number.at(at + 5, 2)));
    ++at;
  }
  return most;
}

std::uint64_t bmp_pixels(Bytes file) {
  const Numbers number(file, true);
  if (number.at(14, 4) == 12) return pixels(number.at(18, 2), number.at(20, 2));  // OS/2's header
  const auto height = static_cast<std::int32_t>(number.at(22, 4));                // below 0: from the top
  return pixels(number.at(18, 4), height < 0 ? 0u - static_cast<std::uint32_t>(height) : number.at(22, 4));
}

/// "P6 640 480", with comments.
std::uint64_t pnm_pixels(Bytes file) {
  std::size_t at = 2;
  const auto number = [&]() -> std::uint64_t {
    while (at < file.size() && (std::isspace(file[at]) != 0 || file[at] == '#')) {
      if (file[at] == '#')
        while (at < file.size() && file[at] != '\n') ++at;
      else
        ++at;
    }
    std::uint64_t value = 0;
    for (; at < file.size() && std::isdigit(file[at]) != 0; ++at)
      value = std::min<std::uint64_t>(value * 10 + (file[at] - '0'), 0xFFFFFFFF);
    return value;
  };
  const std::uint64_t width = number();
  return width * number();
}

/// Of its first directory: the picture, or a tile of it where that is larger. 0 where a tag that says how
/// much memory is taken comes twice, or is what no camera's picture has.
std::uint64_t tiff_pixels(Bytes file, bool little_endian) {
  const Numbers number(file, little_endian);
  const std::size_t directory = number.at(4, 4);
  const std::uint32_t entries = number.at(directory, 2);
  enum Tag { kWidth, kHeight, kTileWidth, kTileHeight, kSamples, kBits, kTags };
  static constexpr std::uint32_t kNumbers[kTags] = {256, 257, 322, 323, 277, 258};
  std::optional<std::uint32_t> found[kTags];
  for (std::uint32_t i = 0; i < entries; ++i) {
    const std::size_t at = directory + 2 + std::size_t{12} * i;
    for (int tag = 0; tag < kTags; ++tag) {
      if (number.at(at, 2) != kNumbers[tag]) continue;
      constexpr std::uint32_t kShort = 3, kLong = 4;
      const std::uint32_t type = number.at(at + 2, 2), count = number.at(at + 4, 4);
      if (found[tag] || (type != kShort && type != kLong)) return 0;
      found[tag] = type == kShort ? number.at(at + 8, 2) : number.at(at + 8, 4);
      if (count != 1 && tag != kBits) return 0;
      if (tag == kBits && count != 1) found[tag] = 16;  // one a sample, elsewhere; decoders check them
    }
  }
  if (found[kSamples].value_or(1) > 4 || found[kBits].value_or(1) > 16) return 0;
  return std::max(pixels(found[kWidth].value_or(0), found[kHeight].value_or(0)),
                  pixels(found[kTileWidth].value_or(0), found[kTileHeight].value_or(0)));
}

bool is_tiff(Bytes file) {
  return begins_with(file, std::string_view("II*\0", 4)) || begins_with(file, std::string_view("MM\0*", 4));
}

bool is_pnm(Bytes file) {
  return file.size() > 2 && file[0] == 'P' && file[1] >= '1' && file[1] <= '6' && std::isspace(file[2]) != 0;
}

/// OpenCV's decoders write lines of their own to std::cerr, which nothing here writes to: nowhere, for its
/// life.
class QuietDecoders {
 public:
  QuietDecoders() : lock_(one_at_a_time()), before_(std::cerr.rdbuf(nullptr)) {}
  QuietDecoders(const QuietDecoders&) = delete;
  QuietDecoders& operator=(const QuietDecoders&) = delete;
  ~QuietDecoders() { std::cerr.rdbuf(before_); }

 private:
  static std::mutex& one_at_a_time() {
    static std::mutex mutex;
    return mutex;
  }
  const std::lock_guard<std::mutex> lock_;
  std::streambuf* const before_;
};

}  // namespace

std::optional<std::uint64_t> declared_pixels(Bytes file) {
  std::uint64_t found = 0;
  if (begins_with(file, kPng)) {
    found = png_pixels(file);
  } else if (begins_with(file, kJpeg)) {
    found = jpeg_pixels(file);
  } else if (begins_with(file, "BM")) {
    found = bmp_pixels(file);
  } else if (is_pnm(file)) {
    found = pnm_pixels(file);
  } else if (is_tiff(file)) {
    found = tiff_pixels(file, file[0] == 'I');
  }
  return found > 0 ? std::optional(found) : std::nullopt;
}

Result<Image8> read_rgb(const std::filesystem::path& path) {
  const std::string name = path.string();
  const auto content = read_whole_file(path, kMostPictureBytes);
  if (!content) return content.error();
  const std::span file(reinterpret_cast<const std::uint8_t*>(content->data()), content->size());
  const auto declared = declared_pixels(file);
  if (!declared && (begins_with(file, "BM") || is_pnm(file) || is_tiff(file)))
    return Error{name + " does not say how large it is: is it cut short or damaged?"};
  if (!declared) return Error{name + " cannot be read as a picture: it is no PNG, JPEG, BMP, PNM or TIFF"};
  if (*declared > kMostPicturePixels || *declared > kMostPicturePixelsPerByte * file.size())
    return Error{name + " says it has " + std::to_string(*declared) + " pixels: is it cut short or damaged?"};
  const auto named = [&](Result<Image8> picture) {
    return picture ? std::move(picture) : Error{name + " " + picture.error().message};
  };
  if (begins_with(file, kPng)) {
    const auto whole = check_png(file);
    return named(whole ? decode_png(file) : whole.error());
  }
  if (begins_with(file, kJpeg)) return named(decode_jpeg(file));
  try {
    const QuietDecoders quiet;
    const cv::Mat bgr = cv::imdecode(cv::_InputArray(file.data(), static_cast<int>(file.size())),
                                     cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    if (bgr.empty()) return Error{name + " cannot be read as a picture: is it cut short or damaged?"};
    Image8 rgb(bgr.cols, bgr.rows, 3);
    cv::Mat out(rgb.height(), rgb.width(), CV_8UC3, rgb.data());
    cv::cvtColor(bgr, out, cv::COLOR_BGR2RGB);
    return rgb;
  } catch (const cv::Exception& e) {
    return Error{name + " cannot be read as a picture: " + e.err};
  }
}

}  // namespace relievo
