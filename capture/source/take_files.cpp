// SPDX-License-Identifier: Apache-2.0
#include "capture/source/take_files.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <string>

#include "base/whole_file.h"
#include "capture/picture_decode.h"
#include "capture/picture_file.h"
#include "capture/png_check.h"

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

}  // namespace

std::filesystem::path take_picture(const std::filesystem::path& take, std::uint64_t number) {
  return take / "frames" / numbered(number, ".png");
}

std::filesystem::path take_truth(const std::filesystem::path& take, std::uint64_t number) {
  return take / "truth" / numbered(number, ".npy");
}

Status check_apart(const std::filesystem::path& folder, const std::filesystem::path& take) {
  for (const char* part : {"", "frames", "truth"}) {
    std::error_code not_there;
    if (std::filesystem::equivalent(folder, take / part, not_there))
      return Error{folder.string() + " holds the take's own files: give the results a folder of their own"};
  }
  return {};
}

Result<std::vector<TakeStamp>> read_timestamps(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto text = read_whole_text(file, kMostTimestampBytes);
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
  auto picture = decode_png(bytes);
  return picture ? std::move(picture) : Error{name + " " + picture.error().message};
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
  return write_whole_file(file, bytes);
}

}  // namespace relievo
