// SPDX-License-Identifier: Apache-2.0
// Texture codec 1: one baseline JPEG, 4:2:0.
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Appends the JPEG of an RGB (3 channels) or grey (1) picture, at most 65500 pixels a side, quality 1..100.
/// Deterministic. Any thread; each keeps a compressor for its next call.
Status append_jpeg(View8 picture, int quality, Bytes& out);

/// Any bytes. RGB. Fails unless the JPEG's own header says `width` and `height` (checked before the picture
/// is allocated), on any warning of the decoder, and on kinds the format does not allow (progressive ones,
/// say).
Result<Image8> decode_jpeg(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height);

}  // namespace relievo
