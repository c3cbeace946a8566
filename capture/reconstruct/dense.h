// SPDX-License-Identifier: Apache-2.0
// The dense option: a surface with a vertex at each pixel of a detection line. Between two boundaries that
// lie side by side on one surface the projector's column rises steadily, so it is interpolated there, not
// depth: on a plane it is a ratio of linear functions of the pixel, whatever the lenses' poses.
#pragma once

#include <cstddef>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/surface.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// In vertices.
struct DenseCounts {
  std::size_t measured = 0;      // pixels that hold a boundary
  std::size_t interpolated = 0;  // pixels between two
  std::size_t alone = 0;         // boundaries on no surface with another one on their line: left out
};

/// Keeps its scratch memory from frame to frame. One thread.
class DenseSampler {
 public:
  /// `measured` on the grid of `columns` (any order; one a place counts, the one whose column is there) and
  /// its `links` across. `out` is overwritten: by line, then pixel; `at.column_px` is whole, `at.boundary`
  /// the boundary at or left of it. `width_px` is the camera's.
  DenseCounts sample(const std::vector<GridVertex>& measured, const ColumnGrid& columns,
                     const GridLinks& links, const Triangulator& triangulator, int width_px, WorkerPool& pool,
                     std::vector<GridVertex>& out);

 private:
  struct Knot {
    float column_px;
    float sigma_px;
    float slope;         // boundaries a pixel
    float slope_px = 0;  // edge slope, as GridVertex::slope
    bool filled;
  };
  struct Scratch {
    std::vector<Knot> knots;  // of one piece of surface on one line
    std::vector<GridVertex> vertices;
    DenseCounts counts;
  };
  static void sample_piece(int first_boundary, int line, const Triangulator& triangulator, int width_px,
                           Scratch& scratch);

  std::vector<std::int32_t> vertex_;  // [line][boundary]: of `measured`, or -1
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
