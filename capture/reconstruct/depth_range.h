// SPDX-License-Identifier: Apache-2.0
// Where on a line a boundary can be seen, if the scene's depths are about those of the frame before. One
// slide's colours and their order repeat over the pattern; over the depths that there are they seldom do.
#pragma once

#include <array>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// Camera columns between which a boundary lies.
using ColumnRange = std::array<float, 2>;

/// Keeps its scratch memory from frame to frame. One thread.
class DepthRange {
 public:
  /// `width` of the camera's picture, `lines` of detection. One line in `every` is asked.
  DepthRange(int boundaries, int width, int lines, int every = 1);

  /// From a frame's points, of which there are so many; few of them change nothing.
  void update(const DecodedGrid& grid, std::size_t points, const Triangulator& triangulator,
              WorkerPool& pool);

  /// One a boundary; null until a frame was seen.
  const std::vector<ColumnRange>* columns() const { return known_ ? &columns_ : nullptr; }

 private:
  ColumnRange range_of(int boundary, std::array<float, 2> range, const Triangulator& triangulator) const;

  bool known_ = false;
  int width_, lines_, every_;
  std::vector<ColumnRange> columns_;
  RankedSample depths_;
};

}  // namespace relievo
