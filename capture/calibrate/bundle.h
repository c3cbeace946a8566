// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment of a rig over views of a flat board: both lenses, the pose between them and every board
// pose at once, with a robust loss, and with mild priors for what few views of a flat board cannot tell.
#pragma once

#include <array>
#include <vector>

#include "base/result.h"
#include "base/rig.h"
#include "capture/calibrate/board.h"

namespace relievo {

/// Rotation vector (radians, axis times angle) and translation (metres): X_to = R X_from + t.
using Pose = std::array<double, 6>;

/// One corner seen by both devices.
struct CornerSight {
  Vec2d board_m{};
  Vec2d camera_px{};
  Vec2d projector_px{};
};

struct BoardView {
  std::vector<CornerSight> corners;
  Pose camera_from_board{};
};

struct BundleProblem {
  PinholeModel camera, projector;  // start values; their sizes stay
  Pose projector_from_camera{};
  std::vector<BoardView> views;
};

/// Standard deviations of the priors; that of the data in one direction is `noise_px`.
struct BundlePriors {
  double noise_px = 0.3;
  double loss_px = 1.0;  // where the robust (Cauchy) loss begins to bend
  double centre = 0.25;  // principal point from the picture's centre, as a share of its width; camera
  double projector_centre_x = 0.1;  // the same of the projector, across: its lens shifts up and down only
  double projector_centre_y = 0.25;
  double aspect = 0.005;  // fx / fy - 1
  double k1 = 0.5, k2 = 1.0, k3 = 0.5;
  double tangential = 0.005;
  double projector_k1 = 0.15, projector_k2 = 0.3, projector_k3 = 0.1;
  double projector_tangential = 0.002;
};

/// Both lenses and the pose between them.
struct Devices {
  PinholeModel camera, projector;
  Pose projector_from_camera{};
};

/// The rig of these, with nothing else in it.
Rig rig_of(const Devices& devices);

struct BundleResult : Devices {
  std::vector<Pose> camera_from_board;
  /// The devices moved by one standard deviation in directions that are independent of each other: what
  /// follows from the devices has the root of the sum of the squares of what these change of it.
  std::vector<Devices> deviations;
  /// Standard deviations from the data and the priors, pixels: fx fy cx cy of camera, then of projector.
  std::array<double, 8> sigma_px{};
  double cost = 0;  // comparable between starts of one problem with the same priors
  int rounds = 0;
};

/// Levenberg-Marquardt until the cost no longer falls. Fails where the problem is degenerate.
Result<BundleResult> adjust_bundle(const BundleProblem& problem, const BundlePriors& priors);

/// Pixel at which a lens sees board point `board_m`.
Vec2d project_board(const PinholeModel& lens, const Pose& lens_from_board, Vec2d board_m);

/// first, then second: x -> second(first(x)).
Pose compose(const Pose& second, const Pose& first);
Pose inverse(const Pose& pose);
/// Row-major.
std::array<double, 9> rotation_matrix(const Pose& pose);

}  // namespace relievo
