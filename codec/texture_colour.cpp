// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_colour.h"

#include <algorithm>
#include <cmath>

namespace relievo {

Colour texture_colour(View8 texture, const Vec2f& at) {
  const float x = std::clamp(at[0] * static_cast<float>(texture.width) - 0.5f, 0.0f,
                             static_cast<float>(texture.width - 1));
  const float y = std::clamp(at[1] * static_cast<float>(texture.height) - 0.5f, 0.0f,
                             static_cast<float>(texture.height - 1));
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, texture.width - 1);
  const int y1 = std::min(y0 + 1, texture.height - 1);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  Colour colour{};
  for (int c = 0; c < 3; ++c) {
    const int channel = std::min(c, texture.channels - 1);
    const auto value = [&](int column, int row) {
      return static_cast<float>(texture.row(row)[column * texture.channels + channel]);
    };
    const float top = value(x0, y0) + fx * (value(x1, y0) - value(x0, y0));
    const float bottom = value(x0, y1) + fx * (value(x1, y1) - value(x0, y1));
    colour[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(std::lround(top + fy * (bottom - top)));
  }
  return colour;
}

Colour vertex_colour(const Surface& surface, View8 texture, std::size_t index) {
  constexpr Colour kNoTexture{200, 200, 200};
  return texture.empty() || surface.texture_coordinates.empty()
             ? kNoTexture
             : texture_colour(texture, surface.texture_coordinates[index]);
}

}  // namespace relievo
