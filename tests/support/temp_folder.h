// SPDX-License-Identifier: Apache-2.0
// A folder of its own for one test, removed with it; files that grow.
#pragma once

#include <stdlib.h>
#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "tests/support/patience.h"

namespace relievo::test {

class TempFolder {
 public:
  TempFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "relievo-test-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// A pipe without a writer, in place of what has the name: opening it to read waits for ever.
inline bool make_pipe(const std::filesystem::path& at) {
  std::filesystem::remove(at);
  return mkfifo(at.c_str(), 0600) == 0;
}

/// Waits until another process has written that much of it.
inline bool wait_for_size(const std::filesystem::path& file, std::uintmax_t bytes) {
  return eventually([&] {
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    return !error && size >= bytes;
  });
}

}  // namespace relievo::test
