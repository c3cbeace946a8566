// SPDX-License-Identifier: Apache-2.0
// What one view of a board under a code tells of it: each corner as the camera and as the projector see it.
// Corners are found in the camera's picture; where the projector sees them follows from the code's edges
// around them (local_homography.h).
#pragma once

#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/rig.h"
#include "capture/calibrate/board.h"
#include "capture/calibrate/bundle.h"
#include "capture/calibrate/stripe_decode.h"
#include "capture/pattern/gray_decode.h"

namespace relievo {

/// What one view shows of the board.
struct MeasuredView {
  std::string name;
  std::vector<CornerSight> corners;  // seen by both devices
  std::string refused;               // why the view cannot be used; empty where it can
};

/// Finds the board in the stack's pictures and each corner in the projector. A view is refused where no board
/// is seen (of a chessboard, the whole one), where fewer than 8 corners are, or where fewer than three
/// quarters of those seen have a place in the projector.
MeasuredView measure_view(const std::string& name, const GrayStack& stack, const Board& board,
                          const GrayDecodeOptions& options, WorkerPool& pool);

/// The same under our own stripes. `colours` are the rig's, or CameraColours{} where they are not known.
MeasuredView measure_view(const std::string& name, const StripeStack& stack, const Board& board,
                          const CameraColours& colours, WorkerPool& pool);

}  // namespace relievo
