// SPDX-License-Identifier: Apache-2.0
// Files that others should not read.
#pragma once

#include <filesystem>
#include <system_error>

namespace relievo {

/// Whether every user of this machine may.
inline bool readable_by_all(const std::filesystem::path& file) {
  std::error_code ignored;
  const auto permissions = std::filesystem::status(file, ignored).permissions();
  return !ignored && (permissions & std::filesystem::perms::others_read) != std::filesystem::perms::none;
}

}  // namespace relievo
