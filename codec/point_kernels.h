// SPDX-License-Identifier: Apache-2.0
// What of GridPoints takes every place or cell: as GridKernels, a portable reference and others with the same
// results.
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame3d.h"

namespace relievo {

/// Light sheets without distortion, one a boundary: z = numerator / (a x + b y + c) on the ray (x, y, 1).
struct Sheets {
  const float *numerator, *a, *b, *c;
};
/// One line's places: their columns, kAbsent where there is no vertex; rays; z and dz/dx, which may be null.
struct SheetRow {
  const std::int32_t* columns;
  const float *ray_x, *ray_y;
  float *slope, *z;
};
/// Rays of a line of a lens without distortion: x = column per_px - first.
struct StraightRays {
  float step_px, per_px, first, y;
};
/// One line's places on their way to vertices: the first one's comes at `position` and so on, without gaps.
struct PlacedRow {
  const std::int32_t* columns;
  const float *column_px, *ray_x, *ray_y, *z;
  float per_width, v;  // of texture coordinates
  std::uint16_t line;
  Vec3f* position;
  Vec2f* coordinate;
  GridPoint* place;
};
/// One line's cells, and the numbers of the vertices above and below them, one more than there are cells.
struct NumberedCells {
  const std::uint8_t* cells;
  const std::int32_t *above, *below;
};

struct GridPointKernels {
  const char* name;
  /// Fills slope and z. False where a vertex is not in front of the camera. `count` rounded up to 8 places.
  bool (*meet)(const SheetRow& row, const Sheets& sheets, int count);
  /// Fills columns in pixels and rays; of no meaning where there is no vertex.
  void (*straight_rays)(const std::int32_t* columns, const StraightRays& rays, int count, float* column,
                        float* x, float* y);
  /// Numbers a line's vertices from `next` on: fills the number of each place's, or where there is none that
  /// of the next one, and returns the number after the last. `count` rounded up to 8 places.
  std::int32_t (*number)(const std::int32_t* columns, int count, std::int32_t next, std::int32_t* index);
  /// Fills positions, texture coordinates and places, without sigma or mark. `count` rounded up to 8 places.
  void (*vertices)(const PlacedRow& row, int count);
  /// Writes the triangles of `count` cells and returns their end.
  Triangle* (*triangles)(const NumberedCells& row, int count, Triangle* to);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<GridPointKernels>& all_grid_point_kernels();

}  // namespace relievo
