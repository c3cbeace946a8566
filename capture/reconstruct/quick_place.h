// SPDX-License-Identifier: Apache-2.0
// How good the quick decoder's zero crossings are, and where the scene has contrast, which draws blurred
// colour off its place, where luma has the boundary: what refine.h does for every edge, for those few.
#pragma once

#include <array>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/luma_place.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class QuickPlacer {
 public:
  /// `colour_matrix` must have an inverse.
  explicit QuickPlacer(const std::array<double, 9>& colour_matrix) : placer_(colour_matrix) {}

  /// Sets contrast, steps and standard deviations of the decoded edges, and moves those in contrast.
  /// `colours` are those on both sides of each boundary, under the slide that `image` shows; `slide` is the
  /// field under that slide itself, a row a line.
  void place(const QuadImage& image, View8 slide, const SequenceResult& result,
             const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges);

 private:
  /// Of an edge in contrast, what luma shows.
  struct Seen {
    std::uint32_t edge;
    float column_px, sigma_px, level_px;  // 0 sigma: luma shows no step, though it should
  };
  struct Scratch {
    std::vector<std::int16_t> brightest, darkest;
    std::vector<Seen> seen;  // of the worker's lines
  };
  void look_at_line(const QuadImage& image, View8 slide, int line, const SequenceResult& result,
                    const std::vector<std::array<Primary, 2>>& colours, int worker, EdgeImage& edges);
  bool look_at_luma(const QuadImage& image, int line, const std::array<Primary, 2>& colours, const Edge& edge,
                    Seen& out) const;

  LumaPlacer placer_;
  float share_ = 1;
  RankedSample by_contrast_;  // how far contrast draws zero crossings
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
