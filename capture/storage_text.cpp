// SPDX-License-Identifier: Apache-2.0
#include "capture/storage_text.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <sstream>

namespace relievo {
namespace {

constexpr std::uintmax_t kMaxFileBytes = 1u << 20;  // no rig or pattern comes near it
constexpr int kMaxNesting = 16;                     // nor this
constexpr int kMaxTags = 1000;                      // nor this; known calibrations have about 100

/// OpenCV prints every error to stderr before it throws; the caller reports it once, in its own words.
void silence_opencv() {
  static const bool done = [] {
    cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
    return true;
  }();
  static_cast<void>(done);
}

bool is_comment(const std::string& line) {
  const std::size_t first = line.find_first_not_of(' ');
  return first != std::string::npos && line[first] == '#';
}

/// OpenCV's parser calls itself for each level and would run out of stack. "[[[", "{{{" and "- - -" nest on a
/// line; how deep indentation can go is bounded by kMaxFileBytes. Lines that are comments nest nothing.
bool nests_too_deep(const std::string& content) {
  int brackets = 0, dashes = 0;
  std::istringstream lines(content);
  for (std::string line; std::getline(lines, line);) {
    if (is_comment(line)) continue;
    dashes = 0;
    for (const char c : line) {
      if (c == '[' || c == '{') ++brackets;
      if (c == ']' || c == '}') --brackets;
      if (c == '-') ++dashes;
      if (c != '-' && c != ' ') dashes = 0;
      if (brackets > kMaxNesting || dashes > kMaxNesting) return true;
    }
  }
  return false;
}

/// Whether the file is one map that begins at its lines' first column and is all there is. Behind the end of
/// anything else OpenCV's parser looks for another document, and never leaves where a "-" comes instead.
bool is_one_map(const std::string& content) {
  if (content.find('\0') != std::string::npos) return false;
  bool begun = false, in_map = false, ended = false;
  std::istringstream lines(content);
  for (std::string line; std::getline(lines, line);) {
    line.erase(line.find_last_not_of(" \t\r") + 1);
    if (line.empty() || is_comment(line)) continue;
    if (ended) return false;
    if (in_map) {
      ended = line == "...";
      if (!ended && (line.starts_with("---") || line.starts_with("..."))) return false;
    } else if (line == "---" && !begun) {
      begun = true;
    } else if (begun || line[0] != '%') {
      in_map = std::isalpha(static_cast<unsigned char>(line[0])) != 0 || line[0] == '_';
      if (!in_map) return false;
    }
  }
  return in_map;
}

/// Empty where the parser may have it. XML nests no deeper than it has tags, however they are written.
std::string trouble(const std::string& content, StorageForm form) {
  if (form == StorageForm::kYamlOrXml && content.starts_with("<?xml")) {
    return std::count(content.begin(), content.end(), '<') > kMaxTags ? "is refused: it has too many tags"
                                                                      : "";
  }
  if (!content.starts_with("%YAML")) {
    return form == StorageForm::kYaml
               ? "is no OpenCV YAML file: it must start with %YAML:1.0"
               : "is no OpenCV YAML or XML file: it must start with %YAML:1.0 or <?xml";
  }
  if (nests_too_deep(content)) return "is refused: it nests too deep";
  return is_one_map(content) ? "" : "is refused: it must be one map of names and values";
}

}  // namespace

Result<std::string> read_storage_text(const std::filesystem::path& file, StorageForm form) {
  const std::string name = file.string();
  std::error_code code;
  if (!std::filesystem::is_regular_file(file, code)) return Error{name + " is missing"};
  if (std::filesystem::file_size(file, code) > kMaxFileBytes || code) return Error{name + " is too large"};
  std::ifstream in(file, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(in), {}};
  if (!in) return Error{name + " cannot be read: check its permissions"};
  if (const std::string wrong = trouble(content, form); !wrong.empty()) return Error{name + " " + wrong};
  silence_opencv();
  return content;
}

}  // namespace relievo
