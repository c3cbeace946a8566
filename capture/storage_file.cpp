// SPDX-License-Identifier: Apache-2.0
#include "capture/storage_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <opencv2/core.hpp>
#include <sstream>
#include <string_view>

#include "base/whole_file.h"

namespace relievo {
namespace {

constexpr std::uintmax_t kMaxFileBytes = 1u << 20;  // no rig or pattern comes near it
constexpr std::size_t kMaxNesting = 16;             // nor this

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
  std::size_t brackets = 0, dashes = 0;
  std::istringstream lines(content);
  for (std::string line; std::getline(lines, line);) {
    if (is_comment(line)) continue;
    dashes = 0;
    for (const char c : line) {
      if (c == '[' || c == '{') ++brackets;
      if ((c == ']' || c == '}') && brackets > 0) --brackets;
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

/// XML as FileStorage writes it: one tree of tags with no attribute but type_id, and ASCII between them. Of
/// anything else OpenCV's parser makes null pointers.
class PlainXml {
 public:
  explicit PlainXml(const std::string& content) : rest_(content) {}

  /// Empty where it is.
  std::string trouble() {
    static constexpr const char* kWrong = "is refused: it is no XML that OpenCV writes";
    if (!take(R"(<?xml version="1.0"?>)")) return kWrong;
    do {
      const std::string_view between = take_until('<');
      const bool is_blank = between.find_first_not_of(" \t\r\n") == std::string_view::npos;
      if ((!is_blank && open_.size() < 2) || !std::ranges::all_of(between, is_plain)) return kWrong;
      if (rest_.empty() || !take_tag()) return kWrong;
      if (open_.size() > kMaxNesting) return "is refused: it nests too deep";
    } while (!open_.empty());
    return rest_.find_first_not_of(" \t\r\n") == std::string_view::npos ? "" : kWrong;
  }

 private:
  static bool is_plain(char c) {
    return (c >= ' ' && c <= '~' && c != '&') || c == '\t' || c == '\r' || c == '\n';
  }
  bool take(std::string_view text) {
    if (!rest_.starts_with(text)) return false;
    rest_.remove_prefix(text.size());
    return true;
  }
  std::string_view take_until(char end) {
    const std::string_view out = rest_.substr(0, rest_.find(end));
    rest_.remove_prefix(out.size());
    return out;
  }
  std::string_view take_name() {
    const auto is_name = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
    };
    const auto end = std::ranges::find_if_not(rest_, is_name);
    const std::string_view out = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(out.size());
    const bool begins =
        !out.empty() && (std::isalpha(static_cast<unsigned char>(out[0])) != 0 || out[0] == '_');
    return begins ? out : std::string_view();
  }
  /// <name>, <name type_id="name"> or the </name> of the one that is open.
  bool take_tag() {
    take("<");
    if (take("/")) {
      const bool closes = !open_.empty() && take_name() == open_.back() && take(">");
      if (closes) open_.pop_back();
      return closes;
    }
    const std::string_view name = take_name();
    if (name.empty() || (open_.empty() && name != "opencv_storage")) return false;
    if (take(" type_id=\"") && (take_name().empty() || !take("\""))) return false;
    open_.push_back(name);
    return take(">");
  }

  std::string_view rest_;
  std::vector<std::string_view> open_;  // outermost first
};

/// Data in base64: OpenCV's reader of it does not end where the text's line does, and nobody writes rigs so.
bool has_base64(const std::string& content) {
  std::istringstream lines(content);
  for (std::string line; std::getline(lines, line);)
    if (!is_comment(line) && line.find("binary") != std::string::npos) return true;
  return false;
}

/// Empty where the parser may have it.
std::string trouble(const std::string& content, StorageForm form) {
  if (has_base64(content)) return "is refused: it has binary data";
  if (form == StorageForm::kYamlOrXml && content.starts_with("<?xml")) return PlainXml(content).trouble();
  if (!content.starts_with("%YAML")) {
    return form == StorageForm::kYaml
               ? "is no OpenCV YAML file: it must start with %YAML:1.0"
               : "is no OpenCV YAML or XML file: it must start with %YAML:1.0 or <?xml";
  }
  if (nests_too_deep(content)) return "is refused: it nests too deep";
  return is_one_map(content) ? "" : "is refused: it must be one map of names and values";
}

/// Fails where the parser may not have it.
Result<std::string> read_text(const std::filesystem::path& file, StorageForm form) {
  auto content = read_whole_text(file, kMaxFileBytes);
  if (!content) return content;
  if (const std::string wrong = trouble(*content, form); !wrong.empty())
    return Error{file.string() + " " + wrong};
  return content;
}

/// A shape's number; -1 where it is none.
int side(const cv::FileNode& node) {
  return node.isInt() ? static_cast<int>(node) : -1;
}

}  // namespace

struct StorageFile::Parsed {
  cv::FileStorage storage;
};

StorageFile::StorageFile(std::unique_ptr<Parsed> parsed) : parsed_(std::move(parsed)) {}
StorageFile::StorageFile(StorageFile&&) noexcept = default;
StorageFile::~StorageFile() = default;

Result<StorageFile> StorageFile::open(const std::filesystem::path& file, StorageForm form) {
  const std::string name = file.string();
  const auto content = read_text(file, form);
  if (!content) return content.error();
  silence_opencv();
  try {
    auto parsed = std::make_unique<Parsed>(
        Parsed{cv::FileStorage(*content, cv::FileStorage::READ | cv::FileStorage::MEMORY)});
    if (!parsed->storage.isOpened()) return Error{name + " is empty"};
    return StorageFile(std::move(parsed));
  } catch (const cv::Exception& e) {
    return Error{name + " is no valid YAML" + (form == StorageForm::kYamlOrXml ? " or XML: " : ": ") + e.err};
  } catch (const std::exception& e) {
    return Error{name + " cannot be read: " + e.what()};
  }
}

bool StorageFile::has(const std::string& key) const {
  const cv::FileNode node = parsed_->storage[key];
  return !node.empty() && !node.isNone();
}

std::optional<double> StorageFile::number(const std::string& key) const {
  const cv::FileNode node = parsed_->storage[key];
  return node.isInt() || node.isReal() ? std::optional(node.real()) : std::nullopt;
}

std::optional<std::string> StorageFile::text(const std::string& key) const {
  const cv::FileNode node = parsed_->storage[key];
  return node.isString() ? std::optional(node.string()) : std::nullopt;
}

std::optional<std::vector<std::optional<std::string>>> StorageFile::texts(const std::string& key) const {
  const cv::FileNode list = parsed_->storage[key];
  if (!list.isSeq()) return std::nullopt;
  std::vector<std::optional<std::string>> out;
  for (const cv::FileNode entry : list)
    out.push_back(entry.isString() ? std::optional(entry.string()) : std::nullopt);
  return out;
}

std::optional<std::vector<std::optional<int>>> StorageFile::whole_numbers(const std::string& key) const {
  const cv::FileNode list = parsed_->storage[key];
  if (!list.isSeq()) return std::nullopt;
  std::vector<std::optional<int>> out;
  for (const cv::FileNode entry : list)
    out.push_back(entry.isInt() ? std::optional(static_cast<int>(entry)) : std::nullopt);
  return out;
}

Status StorageFile::matrix(const std::string& key, int rows, int cols, std::span<double> out) const {
  const std::string shape = std::to_string(rows) + " x " + std::to_string(cols);
  const Error wrong{key + " must be a " + shape + " !!opencv-matrix"};
  const cv::FileNode node = parsed_->storage[key];
  if (!node.isMap()) return wrong;
  const int r = side(node["rows"]), c = side(node["cols"]);
  if (r < 0 || c < 0) return wrong;
  const bool vector = rows == 1 || cols == 1;
  if (!((r == rows && c == cols) || (vector && r == cols && c == rows)))
    return Error{key + " is " + std::to_string(r) + " x " + std::to_string(c) + ", must be " + shape};
  const cv::FileNode type = node["dt"], data = node["data"];
  if (!type.isString() || type.string().size() != 1 || !data.isSeq() || data.size() != out.size())
    return wrong;
  auto to = out.begin();
  for (const cv::FileNode value : data) {
    if (!value.isInt() && !value.isReal()) return wrong;
    *to = value.real();
    if (!std::isfinite(*to++)) return Error{key + " holds a value that is no finite number"};
  }
  return {};
}

}  // namespace relievo
