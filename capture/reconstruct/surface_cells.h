// SPDX-License-Identifier: Apache-2.0
// The cells between two lines of the surface's grid: which triangles they hold and what those add to their
// corners' normals. As rows.h: one portable implementation and others with the same results.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace relievo {

/// One line's vertices, plane after plane; those that are not there are NaN. Rows are as long as the grid's
/// line and padded with NaN by kPadding or more.
struct VertexRow {
  static constexpr int kPadding = 16;
  const float *x, *y, *z;  // metres, camera frame
  const float *x_z, *y_z;  // x / z, y / z
};

/// 1 where the surface goes on: from a vertex to the one below it, and to the next one on the upper and on
/// the lower line. As long as a VertexRow.
struct CellLinks {
  const std::uint8_t *down, *across_above, *across_below;
};

/// See SurfaceOptions.
struct CellLimits {
  float depth_step_ratio, least_facing;
};

/// Corners of a cell run counter-clockwise as the camera sees them (x right, y down): 0 upper left, 1 lower
/// left, 2 lower right, 3 upper right. The first of its triangles is 0 1 2, or where kTurned is set 1 2 3;
/// the second is 2 3 0, or 3 0 1.
namespace cell {
constexpr std::uint8_t kTurned = 1;
constexpr std::uint8_t kFirst = 2, kSecond = 4;             // the triangle is there
constexpr std::uint8_t kFirstJoins = 8, kSecondJoins = 16;  // it is one surface in depth, linked or not
}  // namespace cell

/// What a row of cells adds to the normals of its corners 0 to 3: planes x, y, z of corner 0, then of corner
/// 1 and so on, each `stride` long. Each triangle weighs by its area.
struct CellNormals {
  float* planes;
  std::ptrdiff_t stride;
  float* plane(int corner, int axis) const { return planes + (3 * corner + axis) * stride; }
};

struct CellCounts {
  std::size_t step = 0, edge_on = 0;  // triangles not made, see SurfaceCounts
};

struct CellKernels {
  const char* name;

  /// Cells between `above` and `below`: `count` of them to `cells`, and up to 7 more of nothing behind.
  /// Adds to `counts`.
  void (*make)(const VertexRow& above, const VertexRow& below, const CellLinks& links, int count,
               const CellLimits& limits, std::uint8_t* cells, const CellNormals& normals, CellCounts& counts);

  /// Unit normals of a line of `count` vertices from the cells above and below it; towards the camera's
  /// centre line where there is no triangle. `out` is planes x, y, z, `out_stride` apart.
  void (*normals)(const CellNormals& above, const CellNormals& below, int count, float* out,
                  std::ptrdiff_t out_stride);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<CellKernels>& all_cell_kernels();

/// The best that runs on this machine.
const CellKernels& cell_kernels();

}  // namespace relievo
