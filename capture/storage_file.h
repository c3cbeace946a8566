// SPDX-License-Identifier: Apache-2.0
// The one way to OpenCV's FileStorage files: parsers and matrix readers there believe what a file says, so
// its text is looked at first, and matrices are read number by number into the caller's memory.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"

namespace relievo {

enum class StorageForm { kYaml, kYamlOrXml };

/// What one file says, by the keys of its outermost map. One thread at a time.
class StorageFile {
 public:
  /// At most 1 MB, nested no deeper than the parsers' stack bears, and if YAML one map that is all there is.
  /// Errors name the file. Keeps OpenCV from printing what it throws.
  static Result<StorageFile> open(const std::filesystem::path& file, StorageForm form);
  StorageFile(StorageFile&&) noexcept;
  ~StorageFile();

  bool has(const std::string& key) const;
  /// Nothing where there is no such key, or where it is something else.
  std::optional<double> number(const std::string& key) const;
  std::optional<std::string> text(const std::string& key) const;
  /// An entry that is no text, or no whole number, is nothing.
  std::optional<std::vector<std::optional<std::string>>> texts(const std::string& key) const;
  std::optional<std::vector<std::optional<int>>> whole_numbers(const std::string& key) const;
  /// A matrix of one channel and of that shape, row by row; a vector may lie either way. `out` holds rows x
  /// cols. The error names the key, not the file.
  Status matrix(const std::string& key, int rows, int cols, std::span<double> out) const;

 private:
  struct Parsed;
  explicit StorageFile(std::unique_ptr<Parsed> parsed);
  std::unique_ptr<Parsed> parsed_;
};

}  // namespace relievo
