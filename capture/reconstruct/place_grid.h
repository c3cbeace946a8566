// SPDX-License-Identifier: Apache-2.0
// Where a frame's boundaries are, as a grid over lines and boundaries.
#pragma once

#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/margin_grid.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

struct Place {
  float column_px = kNoColumn;
  float sigma_px = 0;

  bool known() const { return column_px == column_px; }
};

/// Three of the margin, since that many neighbours foretell a place.
class PlaceGrid : public MarginGrid<Place, 3> {
 public:
  /// Those of `result` and `recovered`; memory is reused.
  void fill(int boundaries, WorkerPool& pool, const SequenceResult& result, const EdgeImage& edges,
            const std::vector<RecoveredBoundary>& recovered);
  /// Those that a check left.
  void fill(int boundaries, WorkerPool& pool, ConsistencyCheck& checked);
};

}  // namespace relievo
