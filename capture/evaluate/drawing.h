// SPDX-License-Identifier: Apache-2.0
// What pictures of frames are drawn with.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "base/image.h"

namespace relievo {

using Colour = std::array<float, 3>;  // red, green, blue, 0..1

inline std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.F, 1.F)));
}

/// Of an RGB picture; nothing where the place is outside it.
inline void set_pixel(Image8& picture, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= picture.width() || y >= picture.height()) return;
  for (std::size_t c = 0; c < 3; ++c) picture.row(y)[3 * x + static_cast<int>(c)] = byte_of(colour[c]);
}

/// Grey and dark, for marks to lie on. `picture` is RGB.
inline Image8 dimmed(const Image8& picture) {
  constexpr float kDimmed = 0.35F;
  Image8 out = picture.clone();
  for (int y = 0; y < out.height(); ++y) {
    std::uint8_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x) {
      const int grey = (row[3 * x] + row[3 * x + 1] + row[3 * x + 2]) / 3;
      for (int c = 0; c < 3; ++c)
        row[3 * x + c] = static_cast<std::uint8_t>(kDimmed * static_cast<float>(grey));
    }
  }
  return out;
}

}  // namespace relievo
