// SPDX-License-Identifier: Apache-2.0
// Places that are not sure, after all boundaries are found: those of a silhouette, of a shadow's edge, of
// what moves. Each is weighed against what the boundaries around foretell, on the line and along it, which
// the checks before could not do where these were found later.
#pragma once

#include <cstddef>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Moves columns of `edges` and `recovered`, and updates their standard deviations. `places` are those of
/// both, of one instant. Returns how many were not sure. The same for any number of threads.
std::size_t weigh(const PlaceGrid& places, WorkerPool& pool, const SequenceResult& result, EdgeImage& edges,
                  std::vector<RecoveredBoundary>& recovered);

/// The same from `places` to `out`, whose boundaries are overwritten.
std::size_t weigh(const PlaceGrid& places, WorkerPool& pool, DecodedGrid& out);

}  // namespace relievo
