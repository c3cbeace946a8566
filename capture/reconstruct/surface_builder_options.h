// SPDX-License-Identifier: Apache-2.0
// What a user chooses of a surface.
#pragma once

namespace relievo {

inline constexpr int kMostFilled = 16;

struct SurfaceBuilderOptions {
  bool dense = false;  // a vertex at each pixel of a line, instead of one at each boundary
  int fill_holes = 0;  // missing boundaries or lines that are bridged on one surface, 0..kMostFilled

  bool operator==(const SurfaceBuilderOptions&) const = default;
};

}  // namespace relievo
