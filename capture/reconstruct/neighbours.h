// SPDX-License-Identifier: Apache-2.0
// How a boundary's neighbours on the grid of lines and boundaries went from one frame to the next.
#pragma once

#include <array>
#include <cstddef>

namespace relievo {

/// Lines and boundaries from a place to those around it that are likely of its surface.
inline constexpr std::array<std::array<int, 2>, 14> kNeighbours{{{-1, 0},
                                                                 {1, 0},
                                                                 {-2, 0},
                                                                 {2, 0},
                                                                 {-3, 0},
                                                                 {3, 0},
                                                                 {0, -1},
                                                                 {0, 1},
                                                                 {0, -2},
                                                                 {0, 2},
                                                                 {-1, -1},
                                                                 {1, -1},
                                                                 {-1, 1},
                                                                 {1, 1}}};

/// Pixels along the line, of those that both frames have, in no order that matters.
struct NeighboursWent {
  std::array<float, kNeighbours.size()> px{};
  std::size_t count = 0;
};

/// `went(lines, boundaries)`: how far the neighbour so far away went, NaN where it is not known.
template <typename Went>
NeighboursWent neighbours_went(const Went& went) {
  NeighboursWent out;
  for (const auto& [lines, boundaries] : kNeighbours) {
    const float px = went(lines, boundaries);
    if (px == px) out.px[out.count++] = px;
  }
  return out;
}

}  // namespace relievo
