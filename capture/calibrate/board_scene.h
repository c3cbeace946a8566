// SPDX-License-Identifier: Apache-2.0
// Simulated captures for calibration: a chessboard under Gray code, a white wall under the pattern's colours,
// as a rig of known truth sees them. For trying the calibration out, and for its tests. Same input, same
// bytes.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/calibrate/board.h"
#include "capture/calibrate/bundle.h"

namespace relievo {

struct BoardSceneOptions {
  double noise = 1.2;     // sigma, of 255
  double ambient = 0.04;  // light that is not the projector's, of its white
  int samples = 2;        // a pixel is the mean of samples * samples rays
  std::uint32_t seed = 1;
};

/// `count` poses of the board around `distance_m`, tilted in all directions, at which both devices see the
/// whole board. Fewer where they do not fit: the board is too large for the rig.
std::vector<Pose> example_poses(const Rig& rig, const Board& board, double distance_m, int count,
                                std::uint32_t seed);

/// The board under each of gray_slides() of the rig's projector. One channel.
std::vector<Image8> render_gray_view(const Rig& rig, const Board& board, const Pose& camera_from_board,
                                     const BoardSceneOptions& options);

/// A white sheet before a dark wall at `distance_m` under one projected colour, with the crosstalk of the
/// rig's colour matrix. RGB.
Image8 render_colour_capture(const Rig& rig, Primary colour, double distance_m,
                             const BoardSceneOptions& options);

}  // namespace relievo
