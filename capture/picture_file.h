// SPDX-License-Identifier: Apache-2.0
// Pictures that others took or drew: PNG, JPEG, BMP, PNM and TIFF, told apart by their first bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

inline constexpr std::uint64_t kMostPicturePixels = 100'000'000;
inline constexpr std::size_t kMostPictureBytes = 1 << 30;           // of a file
inline constexpr std::uint64_t kMostPicturePixelsPerByte = 10'000;  // of a file: emptier ones are none

/// What a file's head says of the memory that decoding takes: the picture's pixels, or where it is TIFF those
/// of its largest tile. Nothing where it is of none of those formats, or has no such head.
std::optional<std::uint64_t> declared_pixels(std::span<const std::uint8_t> file);

/// 8 bits, RGB, turned as its Exif says; at most kMostPicturePixels. Errors name the file.
Result<Image8> read_rgb(const std::filesystem::path& file);

}  // namespace relievo
