// SPDX-License-Identifier: Apache-2.0
// Where a frame's boundaries are, as a grid over lines and boundaries.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

struct Place {
  float column_px = std::numeric_limits<float>::quiet_NaN();  // NaN where there is none
  float sigma_px = 0;

  bool known() const { return column_px == column_px; }
};

/// [line][boundary], with a margin of three on all sides that holds nothing, so that neighbours can be asked
/// for without a test. One thread writes a line.
class PlaceGrid {
 public:
  static constexpr int kMargin = 3;

  /// Empty; memory is reused.
  void reset(int boundaries, int lines);
  /// Those of `result` and `recovered`; memory is reused.
  void fill(int boundaries, WorkerPool& pool, const SequenceResult& result, const EdgeImage& edges,
            const std::vector<RecoveredBoundary>& recovered);

  int boundaries() const { return boundaries_; }
  int lines() const { return lines_; }
  std::ptrdiff_t stride() const { return boundaries_ + 2 * kMargin; }
  Place* line(int l) { return places_.data() + (l + kMargin) * stride() + kMargin; }
  const Place* line(int l) const { return places_.data() + (l + kMargin) * stride() + kMargin; }

 private:
  int boundaries_ = 0;
  int lines_ = 0;
  std::vector<Place> places_;
};

}  // namespace relievo
