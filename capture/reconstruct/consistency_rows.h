// SPDX-License-Identifier: Apache-2.0
// What the consistency check (consistency.h) and the instant of a frame (instant.h) ask of every boundary of
// a line. As rows.h: a portable reference, and others with the same results for what a processor can do
// beyond it. Rows are read and written in eights: up to seven places beyond `count`.
#pragma once

#include <cstdint>
#include <vector>

namespace relievo {

/// A boundary's column on a line and on those beside it; NaN: the line does not have it. Rows can be read two
/// places before their first and behind their last.
struct ColumnRows {
  const float *above, *here, *below;
};

/// What a neighbourhood on the grid of lines and boundaries is like.
struct Neighbourhood {
  static constexpr std::uint8_t kOpenAcross = 1;  // no neighbour on one side in the line
  static constexpr std::uint8_t kBentAcross = 2;  // both, but not straight
  static constexpr std::uint8_t kOpenAlong = 4;   // the same over lines
  static constexpr std::uint8_t kBentAlong = 8;
  static constexpr std::uint8_t kSqueezed = 16;  // closer to its neighbours than these are to theirs
};

/// From what on a neighbourhood is bent: a second difference over boundaries of `across_px` and
/// `across_share` of their spacing, over lines of `along_px`, and `noise` standard deviations more. And when
/// it is squeezed: two distances, together, each, or where there is one only, as shares of those beside.
struct NeighbourhoodLimits {
  float across_px, across_share, along_px, noise;
  float squeezed, squeezed_each, squeezed_alone;
};

/// Boundaries of two frames: now, and in the one before.
struct TwoFrames {
  ColumnRows now, before;
  const float *sigma_px, *before_sigma_px;
};

/// How boundaries are moved back towards the frame before, where they were seen well enough (`worst_px`).
struct InstantRules {
  float share;  // of the motion since then, to be taken back
  float worst_px, still_px, alike_px, alike_share, furthest_px;
};

struct ConsistencyKernels {
  const char* name;

  /// Neighbourhood of each boundary; of places without one it tells nothing. `noise_px` is each one's, at
  /// least `least_noise_px`.
  void (*neighbourhoods)(const ColumnRows& rows, const float* noise_px, float least_noise_px, int count,
                         const NeighbourhoodLimits& limits, std::uint8_t* out);

  /// Standard deviations where smoothing moved a column: `averaged` of noise's variance is gone, but no more
  /// than half of all.
  void (*average)(const float* measured_px, const float* smooth_px, const float* noise_px, int count,
                  float averaged, float* sigma_px);

  /// Columns and standard deviations at the frame's instant.
  void (*to_instant)(const TwoFrames& frames, int count, const InstantRules& rules, float* column_px,
                     float* sigma_px);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<ConsistencyKernels>& all_consistency_kernels();

/// The best that runs on this machine.
const ConsistencyKernels& consistency_kernels();

}  // namespace relievo
