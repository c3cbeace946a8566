// SPDX-License-Identifier: Apache-2.0
// How good the quick decoder's zero crossings are, and where the scene has contrast, which draws blurred
// colour off its place, where luma has the boundary: what refine.h does for every edge, for those few.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/luma_place.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/quick_sequence.h"
#include "capture/reconstruct/ranked_sample.h"

namespace relievo {

/// A frame's boundaries as they were found.
struct QuickFrame {
  const QuickImage& image;
  View8 slide;  // the field under the slide that `image` shows, a row a line
  const std::vector<std::array<Primary, 2>>& colours;  // on both sides of each boundary, under that slide
};

/// Keeps its scratch memory, and what a frame tells of light and blur for the next one. One thread.
class QuickPlacer {
 public:
  /// `colour_matrix` must have an inverse.
  explicit QuickPlacer(const std::array<double, 9>& colour_matrix);

  /// Puts the boundaries of `sequence` into the rows of `check`, up to its settle(), with their standard
  /// deviations, and those in contrast where luma has them. Of a boundary that a line has twice the steeper
  /// edge counts. Returns how many others there were.
  std::size_t place(const QuickFrame& frame, QuickSequence& sequence, WorkerPool& pool,
                    ConsistencyCheck& check);

 private:
  /// Of an edge in contrast, what luma shows.
  struct Seen {
    float column_px, sigma_px, level_px;  // 0 sigma: luma shows no step, though it should
  };
  struct Scratch {
    std::vector<std::int16_t> brightest, darkest;
    std::size_t twice = 0;
  };
  std::size_t place_all(const QuickFrame& frame, QuickSequence& sequence, WorkerPool& pool,
                        ConsistencyCheck& check);
  void place_line(const QuickFrame& frame, int line, const QuickLine& edges, int worker, BoundaryRow& row);
  std::uint8_t steps_around(const QuickFrame& frame, int line, float column_px) const;
  bool look_at_luma(const QuickFrame& frame, int line, const QuickLine& edges, int edge, float contrast,
                    Seen& out) const;
  void tell_share(const QuickFrame& frame, int line, const QuickLine& edges, int worker);

  LumaPlacer placer_;
  bool have_before_ = false;
  float share_ = 1;  // of the projector's light in what the frame before showed
  float drawn_px_;   // by a contrast of 1, in the frame before
  RankedSample shares_, by_contrast_;
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
