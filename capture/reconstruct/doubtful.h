// SPDX-License-Identifier: Apache-2.0
// Places that are probably wrong though nothing else gave them up: a few in a thousand, which make most of a
// surface's mean square error.
#pragma once

#include <cstddef>

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/moving_places.h"

namespace relievo {

/// Gives up places of `grid` that are beside the picture, `width` columns wide, to where motion has carried
/// them; and others by three things that tell of large errors on simulated scenes, most of what learners told
/// that were shown all neighbours and the picture: a large standard deviation; stripes beside it that are
/// narrower than the frame's, where a surface turns away and edges blur into each other; and that it is out
/// of line with the three above and with the three below. Sooner where things move: there it is the
/// silhouette's. Returns how many. The same for any number of threads.
std::size_t give_up_doubtful(const MovingPlaces& moving, int width, WorkerPool& pool, DecodedGrid& grid);

}  // namespace relievo
