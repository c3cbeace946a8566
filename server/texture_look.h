// SPDX-License-Identifier: Apache-2.0
// How well the texture of a frame that was sent shows the picture it was made of.
#pragma once

#include <optional>

#include "base/image.h"
#include "base/stream.h"

namespace relievo {

/// PSNR over all samples, dB, at most 99, where `frame` holds a key picture and decodes; the texture alone is
/// decoded. `picture` is what was encoded.
std::optional<double> texture_db(const Bytes& frame, const Image8& picture);

}  // namespace relievo
