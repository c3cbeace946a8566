// SPDX-License-Identifier: Apache-2.0
// The one way to OpenCV's FileStorage parsers: their text first passes here, since they believe what they
// read.
#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"

namespace relievo {

enum class StorageForm { kYaml, kYamlOrXml };

/// The text of a file, for OpenCV to read from memory: at most 1 MB, nested no deeper than the parsers' stack
/// bears, and if YAML one map that is all there is. Errors name the file. Also keeps OpenCV from printing
/// what it throws.
Result<std::string> read_storage_text(const std::filesystem::path& file, StorageForm form);

}  // namespace relievo
