// SPDX-License-Identifier: Apache-2.0
// What moved away uncovers what stood behind it: boundaries that are missing, and look as they did where they
// were last seen to stand still, are there again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/reconstruct/backdrop.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/moving_cells.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/slide_field.h"

namespace relievo {

/// Keeps what stands still from frame to frame. Different lines may be worked on at once, all of them in one
/// step before the next.
class Uncovered {
 public:
  Uncovered(int boundaries, int lines);

  /// Begins a frame whose boundaries are `pitch_px` apart on average.
  void begin(float pitch_px);

  /// Finds those of a line.
  void find(const SlideFieldView& view, int line, const ColumnGrid& now, const MovingCells& moving);

  /// Takes up what of a line stands still, by `before`, the columns of the frame before; not in every frame,
  /// for it takes time, and what stands still stays.
  void remember(const SlideFieldView& view, int line, const EdgeImage& edges, const SequenceResult& result,
                const ColumnGrid& before);

  /// Puts back what was found: on an edge of the difference where both fields show it, else where it stood,
  /// which `restored` gets. Returns how many.
  std::size_t restore(int line, const EdgeImage& edges, ColumnGrid& now, SequenceResult& result,
                      std::vector<RecoveredBoundary>& restored) const;

  const Backdrop& backdrop() const { return backdrop_; }

 private:
  bool stands_around(int line, int boundary, float column_px, const ColumnGrid& now) const;

  Backdrop backdrop_;
  int boundaries_, lines_;
  float pitch_px_ = 0;
  int frame_ = -1;                       // counts
  std::vector<std::uint8_t> uncovered_;  // [line][boundary]
};

}  // namespace relievo
