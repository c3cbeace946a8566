// SPDX-License-Identifier: Apache-2.0
// Columns on a line by those beside them: what is seen of a surface at a boundary its neighbours foretell
// nearly as well, and their noise is their own.
#pragma once

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"

namespace relievo {

/// Moves each column towards the cubic through the two on either side, as their standard deviations weigh,
/// and makes its own as much smaller; none that is not known, nor where the surface bends more than noise
/// does. The same for any number of threads.
void smooth_across(WorkerPool& pool, DecodedGrid& grid);

}  // namespace relievo
