// SPDX-License-Identifier: Apache-2.0
// Folders of pictures, for calibration and import.
#pragma once

#include <filesystem>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

/// Pictures directly in `folder`, in the order of their names, where "2" is before "10". Fails where the
/// folder cannot be read.
Result<std::vector<std::filesystem::path>> pictures_in(const std::filesystem::path& folder);

/// (R + 2 G + B) / 4.
Image8 grey_of(const Image8& rgb);

/// One or three channels, as PNG, written whole or not at all. The error names the file.
Status write_png(const std::filesystem::path& file, const Image8& picture);

}  // namespace relievo
