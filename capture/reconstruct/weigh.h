// SPDX-License-Identifier: Apache-2.0
// Places that are not sure, after all boundaries are found: those of a silhouette, of a shadow's edge, of
// what moves. Each is weighed against what the boundaries around foretell, on the line and along it, which
// the checks before could not do where these were found later. What is still unsure then, or is only held by
// neighbours that pull it far, is given up; sooner where things move.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Every count is of boundaries.
struct WeighingCounts {
  std::size_t moved = 0;
  std::size_t rejected = 0;
};

/// Keeps its scratch memory from frame to frame. One thread.
class Weighing {
 public:
  /// Moves columns of `edges` and `recovered`, and updates their standard deviations; gives up boundaries of
  /// `result` (-1), and takes them out of `recovered`. `places` are those of both, of one instant. `scale` is
  /// ConsistencyCheck's of the frame.
  WeighingCounts weigh(const PlaceGrid& places, const MovingPlaces& moving, float scale, WorkerPool& pool,
                       SequenceResult& result, EdgeImage& edges, std::vector<RecoveredBoundary>& recovered);

  /// The same from `places` to `out`, whose boundaries are overwritten.
  WeighingCounts weigh(const PlaceGrid& places, const MovingPlaces& moving, float scale, WorkerPool& pool,
                       DecodedGrid& out);

 private:
  std::optional<Place> weighed(const Place* own, std::ptrdiff_t stride, float most_px) const;
  bool settle(const PlaceGrid& places, const MovingPlaces& moving, int line, int boundary, float& column_px,
              float& sigma_px) const;

  WeighingCounts total() const;

  float scale_ = 1;                     // of the frame at hand
  std::vector<WeighingCounts> counts_;  // one a worker
};

}  // namespace relievo
