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

/// Where the surface goes on from a vertex to the one below it, of these where both columns are so exact that
/// it does beyond doubt, and to the next one on the upper and on the lower line: rows of bits (eight.h) with
/// a byte behind those of the places.
struct CellLinks {
  const std::uint8_t *down, *sure_down, *across_above, *across_below;
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
constexpr std::uint8_t kCorner = 32;                        // corner 0 is there
constexpr std::uint8_t kSureDown = 64;                      // CellLinks::sure_down
}  // namespace cell

/// Three planes x, y, z, `stride` apart: of triangles' normals, each as long as twice its area.
struct NormalRow {
  float* planes;
  std::ptrdiff_t stride;
  float* axis(int a) const { return planes + a * stride; }
};

struct CellCounts {
  std::size_t step = 0, edge_on = 0;  // triangles not made, see SurfaceCounts
};

/// Two lines' vertices and what lies between them.
struct CellRow {
  const VertexRow &above, &below;
  CellLinks links;
  int count;  // cells, as many as a line has places: the last one has nothing to its right
};

struct CellKernels {
  const char* name;

  /// x / z and y / z of `count` vertices, and up to 7 more of whatever is there.
  void (*views)(const float* x, const float* y, const float* z, int count, float* x_z, float* y_z);

  /// Cells to `cells`, and up to 7 more of nothing behind, as all rows here. `unit` holds what the cells
  /// above the upper line add to its vertices' normals; they become unit normals of that line, towards the
  /// camera's centre line where there is no triangle. `next` becomes what these cells add to the lower
  /// line's. Adds to `counts`.
  void (*make)(const CellRow& row, const CellLimits& limits, std::uint8_t* cells, const NormalRow& unit,
               const NormalRow& next, CellCounts& counts);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<CellKernels>& all_cell_kernels();

/// The best that runs on this machine.
const CellKernels& cell_kernels();

}  // namespace relievo
