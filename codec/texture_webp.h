// SPDX-License-Identifier: Apache-2.0
// Texture codec 2: one lossy WebP.
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Appends the WebP of an RGB (3 channels) or grey (1) picture, at most 16383 pixels a side, quality 1..100,
/// at the least effort: more costs a live stream its rate. Deterministic. Any thread.
Status append_webp(View8 picture, int quality, Bytes& out);

/// Any bytes. RGB. Fails unless the WebP's own header says `width` and `height` (checked before the picture
/// is allocated), and on animations and pictures with alpha.
Result<Image8> decode_webp(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height);

}  // namespace relievo
