// SPDX-License-Identifier: Apache-2.0
// Ends of surfaces that look like boundaries. Where one surface ends before another and the two stripes that
// meet there have the colours of stripes that are neighbours in the pattern, the rim itself is decoded, as
// the front's next boundary or as the one before the back's first. It lies on neither surface. Between such
// a boundary and the next one of the other surface there is one colour only: under both slides, or under one,
// since what the last frame showed there may have been another place's. Which of the two it is, and whether
// it is one, is told by how wide that is, and by where on it the scene's own colour changes, or, where that
// does not, its brightness changes most. What is far from where its own surface foretells it may be a rim
// whatever its colours are. And a surface's last boundary is none where nothing is projected beside it.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Colours to the left and right of each boundary.
using StripeColours = std::vector<std::array<Primary, 2>>;

/// Gives up boundaries of `result` (-1), and takes out of `places` and `recovered`, what may be such a rim,
/// or lies in a shadow. `shown` and `other` are the colours under the frame's slide and under the other one;
/// `front` is FrontEdges::front().
/// `places` are those of both; `image` is what the edges were found in, of `rows`. Says how many there were.
std::size_t drop_rims(const DetectionLines& rows, const DifferenceImage& image, const StripeColours& shown,
                      const StripeColours& other, int front, WorkerPool& pool, PlaceGrid& places,
                      SequenceResult& result, const EdgeImage& edges,
                      std::vector<RecoveredBoundary>& recovered);

}  // namespace relievo
