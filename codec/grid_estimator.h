// SPDX-License-Identifier: Apache-2.0
// What a surface most likely is, from the frames before and the neighbours on it, weighted by the decoder's
// own standard deviations: fewer bits and a better surface than the measurement alone. Before the stripe
// grid's coder; the format knows nothing of it.
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame3d.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// Keeps what it knows of each place from frame to frame. Deterministic. One thread.
class GridEstimator {
 public:
  /// Moves the columns of `grid`, which to_grid() made of `measured`, to their estimates, and its sigmas,
  /// where it has them, to the estimates' own. `tolerance` becomes how far each column may further be moved
  /// without harm, in steps (GridEncoder::encode). Places that are empty stay empty.
  ///
  /// Three things are weighed at each place: the measurement; the estimate of the frame before, moved as the
  /// places around have moved; the middle of neighbours on both sides along the boundary and along the line,
  /// never across a depth step. Each weighs by its variance and by how much more the places around it
  /// disagree with it than their variances explain, so that neither motion nor curvature is smoothed away.
  void estimate(const Surface& measured, StripeGrid& grid, std::vector<std::uint8_t>& tolerance);

  /// The next frame is as the first one.
  void forget() { known_.clear(); }

 private:
  using Plane = std::vector<float>;  // one number a place, as StripeGrid lies in memory

  void start(const StripeGrid& grid);
  void measure(const Surface& measured, const StripeGrid& grid);
  void fuse_times(const StripeGrid& grid);
  void add_neighbours(const StripeGrid& grid, int lines_apart, int boundaries_apart);
  bool linked(const StripeGrid& grid, std::size_t at, int lines_apart, int boundaries_apart) const;
  void sum_around(const StripeGrid& grid, Plane& plane);

  // Of the frames before: column and its variance, pixels; variance 0: nothing known.
  Plane known_, known_variance_;
  // Of this frame.
  Plane column_, variance_;  // measured, then with the frames before; variance 0: no vertex
  Plane weighted_, weight_;  // sums over what is weighed
  Plane count_, sum_, squares_, scratch_;
};

}  // namespace relievo
