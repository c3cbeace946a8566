// SPDX-License-Identifier: Apache-2.0
// The files of a take folder: names, timestamps.csv and pictures (docs/TAKES.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

/// One line of timestamps.csv.
struct TakeStamp {
  std::uint64_t frame = 0;   // names the frame's picture(s)
  std::int64_t time_ns = 0;  // start of its first field
};

/// TAKE/frames/000000.png and TAKE/truth/000000.npy.
std::filesystem::path take_picture(const std::filesystem::path& take, std::uint64_t number);
std::filesystem::path take_truth(const std::filesystem::path& take, std::uint64_t number);

/// Fails where results for `folder` would lie among the take's own files: that is the take, or its frames/ or
/// truth/.
Status check_apart(const std::filesystem::path& folder, const std::filesystem::path& take);

/// At least one line; frames and times strictly increasing. Errors name the file and the line.
Result<std::vector<TakeStamp>> read_timestamps(const std::filesystem::path& file);

/// An 8-bit RGB PNG of exactly this size; its checksums are verified, so that a torn file is an error and
/// never a picture. Errors name the file.
Result<Image8> read_picture(const std::filesystem::path& file, int width, int height);

/// Three channels. The error names the file.
Status write_picture(const std::filesystem::path& file, const Image8& image);

}  // namespace relievo
