// SPDX-License-Identifier: Apache-2.0
// Frame3D: one reconstructed, time-stamped surface with texture. Plain data, move-only because it is large.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"

namespace relievo {

using Vec2f = std::array<float, 2>;
using Vec3f = std::array<float, 3>;
using Triangle = std::array<std::uint32_t, 3>;  // vertex indices, counter-clockwise seen from the camera

/// The stripe boundary a vertex lies on, and the line; where that shows it again, as many lines further.
struct GridPoint {
  std::uint16_t boundary = 0;  // of the pattern: between stripes `boundary` and `boundary` + 1
  std::uint16_t line = 0;      // detection line, top first: camera row `line * line_step_px`
  float column_px = 0;         // sub-pixel camera column, distorted image coordinates
  float sigma_px = 0;          // standard deviation of column_px; 0: not known
  bool interpolated = false;   // not measured there, but between measured points of one surface
};

/// Camera frame: x right, y down, z forward, metres. Vectors beside `positions` are empty or as long as it.
struct Surface {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  // unit, towards the camera
  std::vector<Vec2f>
      texture_coordinates;      // glTF: (0, 0) the texture's upper left corner, (1, 1) the lower right
  std::vector<GridPoint> grid;  // empty where it is not from stripes; what lines show again is last
  std::vector<float> sigmas_m;  // standard deviation of the depth (along z); 0: not known
  std::vector<std::uint8_t> interpolated;  // 1: not measured, but between measured points of one surface
  std::vector<Triangle> triangles;
};

struct Frame3D {
  Frame3D() = default;
  Frame3D(Frame3D&&) = default;
  Frame3D& operator=(Frame3D&&) = default;

  std::uint64_t number = 0;  // the camera frame that completed it, counted by the source from 0
  // Start of that camera frame's first field; where `between`, half a frame earlier: of the white field
  // before it.
  std::int64_t time_ns = 0;
  bool between = false;  // the surface half way between those of two frames (scheme white-field)
  Surface surface;
  Image8 texture;                    // RGB, registered to the camera's picture
  std::int64_t texture_time_ns = 0;  // start of the first field it was made of, as time_ns
};

}  // namespace relievo
