// SPDX-License-Identifier: Apache-2.0
// NumPy's .npy, as far as a take's truth needs it: float32, two dimensions, C order, little endian.
#pragma once

#include <filesystem>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

/// One channel, height x width. The error names the file.
Result<ImageF> read_npy(const std::filesystem::path& file);

/// One channel; written whole or not at all. The error names the file.
Status write_npy(const std::filesystem::path& file, const ImageF& image);

}  // namespace relievo
