// SPDX-License-Identifier: Apache-2.0
#include "base/new_folder.h"

#include <system_error>

namespace relievo {

namespace fs = std::filesystem;

Result<NewFolder> NewFolder::create(const fs::path& folder) {
  NewFolder out;
  if (const Status made = out.make(folder); !made) return made.error();
  return out;
}

Status NewFolder::make(const fs::path& folder) {
  std::error_code failed;
  std::vector<fs::path> missing;
  for (fs::path level = folder;
       !level.empty() && fs::symlink_status(level, failed).type() == fs::file_type::not_found;
       level = level.parent_path())
    missing.push_back(level);
  made_.insert(made_.begin(), missing.begin(), missing.end());
  fs::create_directories(folder, failed);
  if (failed) return Error{"cannot make the folder " + folder.string() + ": " + failed.message()};
  return {};
}

NewFolder::~NewFolder() {
  std::error_code not_empty;
  for (const fs::path& folder : made_) fs::remove(folder, not_empty);
}

}  // namespace relievo
