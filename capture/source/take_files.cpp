// SPDX-License-Identifier: Apache-2.0
#include "capture/source/take_files.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <string>

#include "base/whole_file.h"
#include "capture/picture_file.h"

namespace relievo {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kMostTimestampBytes = 1 << 28;  // of a take of days

std::string numbered(std::uint64_t number, const char* extension) {
  char name[40];
  std::snprintf(name, sizeof name, "%06llu%s", static_cast<unsigned long long>(number), extension);
  return name;
}

template <typename T>
std::optional<T> parse(std::string_view field) {
  T value{};
  const auto [end, code] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (code != std::errc{} || end != field.data() + field.size()) return std::nullopt;
  return value;
}

std::optional<TakeStamp> parse_stamp(const std::string& line) {
  const std::size_t comma = line.find(',');
  if (comma == std::string::npos) return std::nullopt;
  const auto frame = parse<std::uint64_t>(std::string_view(line).substr(0, comma));
  const auto time_s = parse<double>(std::string_view(line).substr(comma + 1));
  if (!frame || !time_s || !(std::abs(*time_s) < 4e9) || *frame > 1'000'000'000) return std::nullopt;
  return TakeStamp{*frame, std::llround(*time_s * 1e9)};
}

std::uint32_t crc32(std::span<const std::uint8_t> data) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> out{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
      out[i] = c;
    }
    return out;
  }();
  std::uint32_t c = 0xFFFFFFFFu;
  for (const std::uint8_t b : data) c = table[(c ^ b) & 255] ^ (c >> 8);
  return ~c;
}

std::uint32_t big_endian(const std::uint8_t* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3];
}

struct PngHeader {
  std::uint32_t width = 0, height = 0;
  int bits = 0, colour_type = 0;
};

/// Walks the chunks before the decoder sees them: libpng would print to stderr and hand back half a picture.
Result<PngHeader> check_png(std::span<const std::uint8_t> file) {
  static constexpr std::uint8_t kSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  if (file.size() < 8 || std::memcmp(file.data(), kSignature, 8) != 0) return Error{"is no PNG file"};
  std::optional<PngHeader> header;
  std::size_t at = 8;
  for (;;) {
    if (file.size() - at < 12) return Error{"is cut short at byte " + std::to_string(at)};
    const std::size_t length = big_endian(&file[at]);
    if (length > file.size() - at - 12)
      return Error{"is cut short in the chunk at byte " + std::to_string(at)};
    const std::span<const std::uint8_t> chunk(&file[at + 4], 4 + length);  // type and data
    if (crc32(chunk) != big_endian(&file[at + 8 + length])) {
      return Error{"is damaged: wrong checksum of the chunk at byte " + std::to_string(at)};
    }
    const std::string_view type(reinterpret_cast<const char*>(chunk.data()), 4);
    if (!header && (type != "IHDR" || length != 13))
      return Error{"is damaged: it does not start with a header"};
    if (!header) header = {big_endian(&chunk[4]), big_endian(&chunk[8]), chunk[12], chunk[13]};
    if (type == "IEND") return *header;
    at += 12 + length;
  }
}

}  // namespace

std::filesystem::path take_picture(const std::filesystem::path& take, std::uint64_t number) {
  return take / "frames" / numbered(number, ".png");
}

std::filesystem::path take_truth(const std::filesystem::path& take, std::uint64_t number) {
  return take / "truth" / numbered(number, ".npy");
}

Result<std::vector<TakeStamp>> read_timestamps(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto text = read_whole_file(file, kMostTimestampBytes);
  if (!text) return text.error();
  std::istringstream in(*text);
  std::vector<TakeStamp> stamps;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    const auto refuse = [&](const std::string& what) {
      return Error{name + " line " + std::to_string(number) + ": " + what};
    };
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() && in.peek() == std::istringstream::traits_type::eof()) break;  // an editor's last line
    if (number == 1) {
      if (line != "frame,time_s") return refuse("must be the header \"frame,time_s\"");
      continue;
    }
    const auto stamp = parse_stamp(line);
    if (!stamp) return refuse("must be a frame number and a time in seconds such as \"3,0.1001\"");
    if (!stamps.empty() && stamp->frame <= stamps.back().frame) return refuse("frame numbers must increase");
    if (!stamps.empty() && stamp->time_ns <= stamps.back().time_ns) return refuse("times must increase");
    stamps.push_back(*stamp);
  }
  if (stamps.empty()) return Error{name + " lists no frame"};
  return stamps;
}

Result<Image8> read_picture(const std::filesystem::path& file, int width, int height) {
  const std::string name = file.string();
  const auto content = read_whole_file(file, kMostPictureBytes);
  if (!content) return content.error();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(content->data()), content->size());
  const Result<PngHeader> header = check_png(bytes);
  if (!header) return Error{name + " " + header.error().message};
  if (header->bits != 8 || header->colour_type != 2) return Error{name + " must be 8-bit RGB"};
  if (header->width != static_cast<std::uint32_t>(width) ||
      header->height != static_cast<std::uint32_t>(height)) {
    return Error{name + " is " + std::to_string(header->width) + " x " + std::to_string(header->height) +
                 ", but rig.yaml says " + std::to_string(width) + " x " + std::to_string(height)};
  }
  try {
    const cv::Mat bgr = cv::imdecode(cv::_InputArray(bytes.data(), static_cast<int>(bytes.size())),
                                     cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    if (bgr.cols != width || bgr.rows != height || bgr.type() != CV_8UC3)
      return Error{name + " cannot be decoded"};
    Image8 image(width, height, 3);
    cv::Mat rgb(height, width, CV_8UC3, image.data());
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    return image;
  } catch (const std::exception&) {
    return Error{name + " cannot be decoded"};
  }
}

Status write_picture(const std::filesystem::path& file, const Image8& image) {
  const std::string name = file.string();
  Bytes bytes;
  try {
    const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<std::uint8_t*>(image.data()));
    cv::Mat bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    if (!cv::imencode(".png", bgr, bytes)) return Error{name + " cannot be encoded"};
  } catch (const std::exception& e) {
    return Error{name + " cannot be encoded: " + e.what()};
  }
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) return Error{name + " cannot be written: is the disk full?"};
  return {};
}

}  // namespace relievo
