// SPDX-License-Identifier: Apache-2.0
// Texture codec 3: one PNG, lossless.
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

enum class PngEffort : std::uint8_t { kFast, kSmall };

/// Appends the PNG of an RGB (3 channels), grey (1) or RGBA (4: no texture, decode_png() refuses it) picture.
/// Deterministic. Any thread.
Status append_png(View8 picture, PngEffort effort, Bytes& out);

/// Appends a grey PNG of 16 bits a pixel; `pixels` row by row.
Status append_grey16_png(std::span<const std::uint16_t> pixels, int width, int height, Bytes& out);

/// Any bytes. RGB, exactly as encoded. Fails unless the PNG's own header says `width` and `height` (checked
/// before the picture is allocated), and on kinds that would have to be converted: other than RGB or grey of
/// 8 bits, or with colours said to be others than sRGB's.
Result<Image8> decode_png(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height);

}  // namespace relievo
