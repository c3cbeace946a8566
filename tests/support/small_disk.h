// SPDX-License-Identifier: Apache-2.0
// A disk that is soon full, for a process that was forked for it.
#pragma once

#include <sched.h>
#include <sys/mount.h>

#include <filesystem>

namespace relievo::test {

/// A file system of its own, that only this process sees, and nothing left behind. `size`: "size=1m".
inline bool mount_small_disk(const std::filesystem::path& folder, const char* size) {
  return ::unshare(CLONE_NEWNS) == 0 && ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         ::mount("none", folder.c_str(), "tmpfs", 0, size) == 0;
}

}  // namespace relievo::test
