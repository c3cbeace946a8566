// SPDX-License-Identifier: Apache-2.0
// A line's boundaries to points at once, where light sheets are straight. As rows.h: one portable
// implementation and others with the same results, which are those of Triangulator::find(), too.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "capture/reconstruct/decoded_grid.h"

namespace relievo {

/// Columns from one sample of a line's rays to the next: linear between them is good to 1e-3 px.
inline constexpr int kRayStep = 8;

/// Of a ray and a sheet in the projector's frame: with less they are parallel.
inline constexpr double kLeastCrossing = 1e-9;

/// What all points of a line share.
struct StraightSheets {
  const float* rays;    // x/z, y/z of the camera's ray at every kRayStep columns
  int ray_samples;      // 2 or more
  const float* sheets;  // x/z in the projector's frame of each boundary; as long as the row, in eights
  std::array<double, 3> across, forward;  // rows x and z of projector_from_camera's rotation
  double translation_x, translation_z;
};

struct PointCounts {
  std::size_t points = 0;    // boundaries that became one
  std::size_t no_point = 0;  // and those that did not
  PointCounts& operator+=(const PointCounts& other) {
    points += other.points;
    no_point += other.no_point;
    return *this;
  }
};

struct TriangulateKernels {
  const char* name;

  /// Of `count` boundaries, and up to 7 more that must be nowhere. Where there is no point, `column_px`
  /// becomes kNoColumn and the point NaN.
  PointCounts (*straight)(const StraightSheets& sheets, int count, float* column_px, const PointRow& out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<TriangulateKernels>& all_triangulate_kernels();

/// The best that runs on this machine.
const TriangulateKernels& triangulate_kernels();

}  // namespace relievo
