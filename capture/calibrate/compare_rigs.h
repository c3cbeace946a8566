// SPDX-License-Identifier: Apache-2.0
// How far a calibrated rig is from another, such as a simulation's truth.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "base/rig.h"

namespace relievo {

struct RigDifference {
  double camera_focal = 0, projector_focal = 0;          // share: 0.01 is one per cent
  double camera_centre_px = 0, projector_centre_px = 0;  // distance of the principal points
  double baseline_m = 0;  // of the vectors between the devices, not only their length
  double rotation_rad = 0;
  /// What the differences together do: a point that the reference sees at `distance_m`, over the camera's
  /// picture where the projector reaches, comes out of the other rig at a depth that is off by this (RMS) ...
  double depth_rms_m = 0;
  double depth_mean_m = 0;  // ... and on average
  /// How the cameras scan where they do otherwise, each as "scan: interlaced, not progressive", the
  /// reference last.
  std::vector<std::string> scanning;
};

/// Fails where the devices' sizes differ or the two see nothing in common at `distance_m`.
Result<RigDifference> compare_rigs(const Rig& rig, const Rig& reference, double distance_m);

}  // namespace relievo
