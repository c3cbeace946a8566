// SPDX-License-Identifier: Apache-2.0
// Folders for results, of which none stays behind empty.
#pragma once

#include <filesystem>
#include <vector>

#include "base/result.h"

namespace relievo {

/// A folder that results are written into, made where it is missing, with those above it. What was made for
/// it goes with this object as far as nothing was put into it.
class NewFolder {
 public:
  /// None yet.
  NewFolder() = default;
  static Result<NewFolder> create(const std::filesystem::path& folder);
  /// The same for one that is held already; nothing is done where the folder is there.
  Status make(const std::filesystem::path& folder);
  NewFolder(NewFolder&&) = default;
  NewFolder& operator=(NewFolder&&) = delete;
  ~NewFolder();

 private:
  std::vector<std::filesystem::path> made_;  // the innermost first
};

}  // namespace relievo
