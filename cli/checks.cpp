// SPDX-License-Identifier: Apache-2.0
#include "cli/checks.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "cli/listen_address.h"

namespace relievo {
namespace {

template <typename T>
bool parse(const std::string& text, T& value) {
  const char* end = text.data() + text.size();
  const auto [rest, failed] = std::from_chars(text.data(), end, value);
  return failed == std::errc() && rest == end;
}

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

/// In small letters.
std::string ending_of(const std::string& name) {
  std::string ending = std::filesystem::path(name).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

std::string refusal(const std::string& value, const char* kind, const std::string& least,
                    const std::string& most) {
  return "'" + value + "' is no " + kind +
         (most.empty() ? " of at least " + least : " from " + least + " to " + most);
}

}  // namespace

ValueCheck whole_number(std::uint64_t least, std::uint64_t most) {
  return [=](const std::string& text) -> std::string {
    std::uint64_t value = 0;
    if (parse(text, value) && value >= least && value <= most) return {};
    const bool open = most == std::numeric_limits<std::uint64_t>::max();
    return refusal(text, "whole number", std::to_string(least), open ? "" : std::to_string(most));
  };
}

ValueCheck number(double least, double most) {
  return [=](const std::string& text) -> std::string {
    double value = 0;
    if (parse(text, value) && std::isfinite(value) && value >= least && value <= most) return {};
    return refusal(text, "number", short_text(least), std::isfinite(most) ? short_text(most) : "");
  };
}

ValueCheck one_of(std::vector<std::string> words) {
  return [words = std::move(words)](const std::string& text) {
    if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
    std::string all;
    for (const std::string& word : words) all += (all.empty() ? "" : ", ") + word;
    return "'" + text + "' is none of " + all;
  };
}

ValueCheck folder_name() {
  return [](const std::string& name) {
    static constexpr std::array kFiles = {".png", ".jpg", ".jpeg", ".webp", ".gif",  ".tif", ".tiff", ".pdf",
                                          ".mp4", ".mkv", ".avi",  ".mov",  ".webm", ".m4v", ".ply",  ".obj",
                                          ".glb", ".stl", ".mcap", ".yaml", ".json", ".gltf"};
    const bool is_file = std::ranges::find(kFiles, ending_of(name)) != kFiles.end();
    return is_file ? "'" + name + "' is named as a file, and a folder would be made: give a folder's name"
                   : std::string();
  };
}

ValueCheck png_name() {
  return [](const std::string& name) {
    return ending_of(name) == ".png" ? std::string() : "'" + name + "' must end in .png: it is a PNG";
  };
}

ValueCheck listen_address(bool optional) {
  return [=](const std::string& text) -> std::string {
    if (optional && text == "none") return {};
    const auto address = parse_listen_address(text);
    return address ? std::string() : address.error().message;
  };
}

}  // namespace relievo
