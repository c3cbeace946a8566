// SPDX-License-Identifier: Apache-2.0
// Bytes as a file for those who take a path, without a disk.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace relievo::fuzz {

/// Where files cost no disk, if there is such a folder.
inline std::filesystem::path folder_in_memory() {
  const std::filesystem::path folder = "/dev/shm";
  return std::filesystem::is_directory(folder) ? folder : std::filesystem::temp_directory_path();
}

class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : handle_(memfd_create("fuzz", MFD_CLOEXEC)) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(handle_, bytes.data(), bytes.size());
      if (written <= 0) break;
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
  }
  ~MemoryFile() { ::close(handle_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(handle_); }

 private:
  const int handle_;
};

}  // namespace relievo::fuzz
