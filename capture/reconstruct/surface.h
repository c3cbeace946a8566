// SPDX-License-Identifier: Apache-2.0
// From decoded boundaries to a surface on the stripe x line grid (paper 5.4, 6: "connectivity is given by the
// nearest boundaries in image space"), cut at depth steps.
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame3d.h"
#include "base/parallel.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/surface_cells.h"

namespace relievo {

/// A measured point with its place on the grid.
struct GridVertex {
  GridPoint at;
  Vec3f position{};  // metres, camera frame
  float slope = 0;   // of the boundary it came from: the better of two at one place is kept
};

/// Of two at one place. The column settles a tie, so that the order of detection never does.
inline bool better(const GridVertex& a, const GridVertex& b) {
  return a.slope != b.slope ? a.slope > b.slope : a.at.column_px < b.at.column_px;
}

struct SurfaceOptions {
  // A cell's edge is cut where its depth step exceeds this many times its extent across the view.
  float depth_step_ratio = 4;
  // Triangles seen more edge-on than this are the curtains that wrong points hang between surfaces: 0.2 keeps
  // surfaces up to 78 degrees off the view's plane.
  float least_facing = 0.2F;
  // Connected pieces with fewer vertices are most often wrong codes; 0 keeps vertices in no triangle, too. Of
  // one boundary that goes on from line to line by itself, as links tell, twice as many are asked.
  int least_component = 10;
  // Where the surface goes on from one grid place to the next: triangles keep to it. Null: depth alone tells.
  const GridLinks* links = nullptr;
  // Shares the lines; null: the caller's thread does them all.
  WorkerPool* pool = nullptr;
  // The better vertex of each grid place, [line][boundary], -1 where there is none, where the caller has
  // found them already; it has counted the duplicates then. Null: they are found, and counted, here.
  const std::vector<std::int32_t>* places = nullptr;
  // The grid is [line][whole column_px] instead of [line][boundary], and `boundaries` its width.
  bool by_pixel = false;
};

/// What a surface lost to its filters.
struct SurfaceCounts {
  std::size_t duplicate = 0;        // vertices at a grid place that a better one has
  std::size_t small_component = 0;  // vertices in pieces below least_component
  std::size_t step = 0;             // triangles that would bridge a depth step
  std::size_t edge_on = 0;          // triangles seen more edge-on than least_facing
};

/// Grows with use and is kept from frame to frame.
struct SurfaceScratch {
  struct Worker {
    std::vector<float> normals;       // of two rows of cells
    std::vector<std::uint8_t> links;  // of one, padded
    CellCounts counts;
    std::size_t small = 0;  // vertices in small pieces
  };
  std::vector<std::int32_t> vertex;  // [line][boundary]: in the list, or -1
  std::vector<float> planes;         // [line][x, y, z, x / z, y / z][boundary, padded]
  std::vector<float> normals;        // [line][x, y, z][boundary]
  std::vector<std::uint8_t> cells;   // [line][boundary, padded]: see namespace cell
  std::vector<std::int32_t> index;   // [line][boundary]: in the output, or -1; before that, its run
  std::vector<std::int32_t> parent;  // union-find over runs: vertices that hang together on a line
  std::vector<std::int32_t> size;    // of a root's component
  std::vector<std::uint8_t> kept;    // of a run: its component is large enough
  std::vector<std::uint32_t> vertices_before, triangles_before;  // of each line, in the output
  std::vector<Worker> workers;
};

/// `vertices` in any order. Fills positions, normals, grid and triangles of `out`, in order of line and
/// boundary. The same for any number of threads.
SurfaceCounts build_surface(const std::vector<GridVertex>& vertices, int boundaries, int lines,
                            const SurfaceOptions& options, SurfaceScratch& scratch, Surface& out);

}  // namespace relievo
