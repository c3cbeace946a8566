// SPDX-License-Identifier: Apache-2.0
// Grids of decoded boundaries from points given one by one.
#pragma once

#include <vector>

#include "base/frame3d.h"
#include "capture/reconstruct/decoded_grid.h"

namespace relievo::test {

/// A measured point with its place on the grid.
struct GridVertex {
  GridPoint at;
  Vec3f position{};  // metres, camera frame
  float slope = 0;   // of the boundary it came from
};

/// `vertices` in any order.
inline DecodedGrid decoded_grid(const std::vector<GridVertex>& vertices, int boundaries, int lines) {
  DecodedGrid out;
  out.reset(boundaries, lines);
  for (const GridVertex& v : vertices) {
    const int b = v.at.boundary;
    out.put(v.at.line, b, v.at.column_px, v.at.sigma_px, v.slope);
    if (out.column_px(v.at.line)[b] != v.at.column_px || out.slope(v.at.line)[b] != v.slope) continue;
    const PointRow points = out.points(v.at.line);
    points.x[b] = v.position[0];
    points.y[b] = v.position[1];
    points.z[b] = v.position[2];
  }
  return out;
}

}  // namespace relievo::test
