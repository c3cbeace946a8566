// SPDX-License-Identifier: Apache-2.0
#include "base/new_folder.h"

#include <system_error>

namespace relievo {

namespace fs = std::filesystem;

Result<NewFolder> NewFolder::create(const fs::path& folder) {
  NewFolder out;
  std::error_code failed;
  for (fs::path level = folder;
       !level.empty() && fs::symlink_status(level, failed).type() == fs::file_type::not_found;
       level = level.parent_path())
    out.made_.push_back(level);
  fs::create_directories(folder, failed);
  if (failed) return Error{"cannot make the folder " + folder.string() + ": " + failed.message()};
  return out;
}

NewFolder::~NewFolder() {
  std::error_code not_empty;
  for (const fs::path& folder : made_) fs::remove(folder, not_empty);
}

}  // namespace relievo
