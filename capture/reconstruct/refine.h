// SPDX-License-Identifier: Apache-2.0
// Where exactly a decoded boundary lies. Analog video and YUV cameras carry colour at a fraction of luma's
// bandwidth, so the zero crossings of R, G and B are blurred and, beside a depth step, shifted; the step in
// luma is not. Knowing the code, both are used.
#pragma once

#include <array>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

class Refiner {
 public:
  /// `colour_matrix` must have an inverse: luma is that of the captured colours, not of the calibrated ones.
  explicit Refiner(const std::array<double, 9>& colour_matrix);

  /// Moves the columns of the decoded edges and sets their standard deviations and contrasts. `colours` are
  /// those on both sides of each boundary, under the slide that `image` shows.
  void refine(const DifferenceImage& image, const SequenceResult& result,
              const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges) const;

 private:
  struct Sides {
    float free_left_px, free_right_px;  // to the next edges
    float ratio_left, ratio_right;      // luma of the difference over that of the sum, in clean white light
  };
  float projected_share(const DifferenceImage& image, const SequenceResult& result,
                        const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges) const;
  void refine_edge(const DifferenceImage& image, int line, const Sides& sides, Edge& edge) const;

  std::array<float, 3> luma_;   // of the difference image's channels
  std::array<float, 8> ratio_;  // of each primary
};

}  // namespace relievo
