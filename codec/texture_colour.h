// SPDX-License-Identifier: Apache-2.0
// The colour that a texture has at a vertex.
#pragma once

#include <array>
#include <cstdint>

#include "base/frame3d.h"
#include "base/image.h"

namespace relievo {

using Colour = std::array<std::uint8_t, 3>;  // RGB

/// Bilinear, at glTF coordinates: (0, 0) is the outer corner of the first pixel. `texture` is not empty.
Colour texture_colour(View8 texture, const Vec2f& at);

/// That of vertex `index`; light grey where the frame has none.
Colour vertex_colour(const Surface& surface, View8 texture, std::size_t index);

}  // namespace relievo
