// SPDX-License-Identifier: Apache-2.0
// From decoded boundaries with their points to a surface on the stripe x line grid (paper 5.4, 6:
// "connectivity is given by the nearest boundaries in image space"), cut at depth steps.
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame3d.h"
#include "base/parallel.h"
#include "capture/reconstruct/column_links.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/depth_sigma.h"
#include "capture/reconstruct/surface_cells.h"
#include "capture/reconstruct/surface_pieces.h"

namespace relievo {

/// The picture that the grid's columns and lines are of, and how exact its columns make depths.
struct SurfacePicture {
  int width_px, height_px, line_step_px;
  const DepthSlope& depth_slope;
};

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
  // Null: vertices get no texture coordinates and standard deviations, and are not told apart by how they
  // were found.
  const SurfacePicture* picture = nullptr;
  // The boundary that each place is told to be of, in rows as the grid's. Null: places are boundaries.
  const std::uint16_t* boundaries = nullptr;
};

/// What a surface lost to its filters.
struct SurfaceCounts {
  std::size_t small_component = 0;  // vertices in pieces below least_component
  std::size_t step = 0;             // triangles that would bridge a depth step
  std::size_t edge_on = 0;          // triangles seen more edge-on than least_facing
};

/// Grows with use and is kept from frame to frame.
struct SurfaceScratch {
  struct Worker {
    static constexpr std::size_t kRows = 7;
    std::vector<float> rows;          // views of two lines and normals; later what a line's vertices get
    std::vector<std::uint8_t> cells;  // of one line
    std::vector<std::int32_t> index;  // of two lines' places, in the output
    SurfacePieces::Cells above, below;
    CellCounts counts;
  };
  std::vector<float> normals;                     // [line][x, y, z][place, padded]
  std::vector<std::uint8_t> all_links, no_links;  // rows of links where there are none to keep to
  SurfacePieces pieces;
  std::vector<Worker> workers;
};

/// Fills positions, normals, grid and triangles of `out`, in order of line and place, and what
/// options.picture says. The same for any number of threads.
SurfaceCounts build_surface(const DecodedGrid& grid, const SurfaceOptions& options, SurfaceScratch& scratch,
                            Surface& out);

}  // namespace relievo
