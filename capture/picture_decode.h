// SPDX-License-Identifier: Apache-2.0
// PNG and JPEG as pictures of 8-bit RGB. Unlike OpenCV's decoders these write nothing to stderr, and take no
// picture of which a part is missing. Any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

/// A file that check_png() found whole, of a size that the caller wants memory for. Grey becomes RGB, 16 bits
/// become 8, alpha is left out. The error goes on behind the file's name.
Result<Image8> decode_png(std::span<const std::uint8_t> file);

/// The same of a JPEG, grey or in colours.
Result<Image8> decode_jpeg(std::span<const std::uint8_t> file);

/// One that must be of this size, into rows of RGB that begin `stride` bytes one behind the other.
Status decode_jpeg(std::span<const std::uint8_t> file, int width, int height, std::uint8_t* rgb,
                   std::ptrdiff_t stride);

}  // namespace relievo
