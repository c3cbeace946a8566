// SPDX-License-Identifier: Apache-2.0
// Boundaries that the frame before had and this one has not, where all around stands nearly still:
// the other slide's colours there were easier to see. They are still where they were, by how far their
// neighbours went since.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/recover.h"

namespace relievo {

/// Keeps the frame before and its scratch memory. One thread.
class Persistence {
 public:
  /// Adds boundaries to `places` and to `recovered`, which are the frame's, those of each in the other. Once
  /// a frame; what was added is no evidence for the next. Returns how many were added.
  std::size_t carry(const MovingPlaces& moving, WorkerPool& pool, PlaceGrid& places,
                    std::vector<RecoveredBoundary>& recovered);

 private:
  void carry_line(const MovingPlaces& moving, const PlaceGrid& places, int line,
                  std::vector<RecoveredBoundary>& out) const;

  PlaceGrid before_;                                     // without what was carried
  std::vector<std::vector<RecoveredBoundary>> carried_;  // each worker's
};

}  // namespace relievo
