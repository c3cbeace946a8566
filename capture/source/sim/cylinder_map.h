// SPDX-License-Identifier: Apache-2.0
// A surface given by its distance from an upright axis, as a cylindrical scanner would store it: heads,
// vases.
#pragma once

#include <memory>
#include <vector>

#include "capture/source/sim/shape.h"

namespace relievo::sim {

/// Samples of radius and colour over angle and height. Local frame: y down along the axis; angle 0 is the
/// front (-z, towards the camera), growing towards +x. What lies beyond the angles is not there.
struct CylinderMap {
  int columns = 0, rows = 0;
  float angle_limit = 0;          // columns cover -angle_limit .. +angle_limit, radians, not quite evenly
  float top_m = 0, bottom_m = 0;  // rows cover y = top_m .. bottom_m
  std::vector<float> radius_m;    // rows x columns
  std::vector<Vec3> albedo;       // rows x columns
  float gloss = 0;

  void resize(int new_columns, int new_rows);
  float angle(int column) const;
  float height(int row) const {
    return top_m + (bottom_m - top_m) * static_cast<float>(row) / static_cast<float>(rows - 1);
  }
  std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  float column_of(float angle) const;  // angle within +-3.14
  float row_of(float y) const { return (y - top_m) / (bottom_m - top_m) * static_cast<float>(rows - 1); }
};

/// The map, posed. Rays step along the radial distance; features steeper than about 60 degrees to the radius
/// may be cut off at their very rim.
std::shared_ptr<const Shape> make_cylinder_map(const Pose& pose, std::shared_ptr<const CylinderMap> map);

}  // namespace relievo::sim
