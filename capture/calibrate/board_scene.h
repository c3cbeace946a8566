// SPDX-License-Identifier: Apache-2.0
// Simulated captures for calibration: a board under Gray code or stripes, a white wall under the pattern's
// colours, as a rig of known truth sees them. For trying the calibration out, and for its tests. Same input,
// same bytes.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/calibrate/board.h"
#include "capture/calibrate/bundle.h"
#include "capture/calibrate/seen_board.h"
#include "capture/calibrate/stripe_decode.h"

namespace relievo {

/// `count` poses of the board around `distance_m`, tilted in all directions, at which both devices see the
/// whole board. Fewer where they do not fit: the board is too large for the rig.
std::vector<Pose> example_poses(const Rig& rig, const Board& board, double distance_m, int count,
                                std::uint32_t seed);

/// The board under each of gray_slides() of the rig's projector. One channel.
std::vector<Image8> render_gray_view(const Rig& rig, const Board& board, const Pose& camera_from_board,
                                     const BoardSceneOptions& options);

/// The board under the slides of `pattern` along columns and, as row_pattern(), along rows, each with its
/// complement; the projector's lens blurs them by `defocus_px`.
StripeStack render_stripe_view(const Rig& rig, const Board& board, const Pose& camera_from_board,
                               const Pattern& pattern, double defocus_px, const BoardSceneOptions& options);

/// A white sheet before a dark wall at `distance_m` under one projected colour, with the crosstalk of the
/// rig's colour matrix. RGB.
Image8 render_colour_capture(const Rig& rig, Primary colour, double distance_m,
                             const BoardSceneOptions& options);

}  // namespace relievo
