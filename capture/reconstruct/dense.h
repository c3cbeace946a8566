// SPDX-License-Identifier: Apache-2.0
// The dense option: a surface with a vertex at each pixel of a detection line. Between two boundaries that
// lie side by side on one surface the projector's column rises steadily, so it is interpolated there, not
// depth: on a plane it is a ratio of linear functions of the pixel, whatever the lenses' poses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/column_links.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// In vertices.
struct DenseCounts {
  std::size_t measured = 0;      // pixels that hold a boundary
  std::size_t interpolated = 0;  // pixels between two
  std::size_t alone = 0;         // boundaries on no surface with another one on their line: left out
  std::size_t duplicate = 0;     // pixels that a better one is at the place of
};

/// A grid of pixels instead of boundaries, each with its point.
struct DenseGrid {
  DecodedGrid pixels;                     // [line][pixel]; columns are whole
  std::vector<std::uint16_t> boundaries;  // the one at or left of each pixel, in rows as those of `pixels`
};

/// Keeps its scratch memory from frame to frame. One thread.
class DenseSampler {
 public:
  /// Of `measured`, boundaries with their points, and its links across. `out` is overwritten; its memory is
  /// reused. `width_px` is the camera's.
  DenseCounts sample(const DecodedGrid& measured, const GridLinks& links, const Triangulator& triangulator,
                     int width_px, WorkerPool& pool, DenseGrid& out);

 private:
  struct Knot {
    float column_px;
    float sigma_px;
    float slope;         // boundaries a pixel
    float slope_px = 0;  // edge slope, as DecodedGrid::slope()
    bool filled;
  };
  struct Scratch {
    std::vector<Knot> knots;  // of one piece of surface on one line
    DenseCounts counts;
  };
  static void sample_piece(int first_boundary, int line, const Triangulator& triangulator, Scratch& scratch,
                           DenseGrid& out);

  std::vector<Scratch> scratch_;
};

}  // namespace relievo
