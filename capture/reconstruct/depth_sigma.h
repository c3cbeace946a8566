// SPDX-License-Identifier: Apache-2.0
// How exact a point is: from the standard deviation of its column in the picture to that of its depth.
#pragma once

#include "base/frame3d.h"
#include "base/rig.h"

namespace relievo {

/// Metres of depth (along the camera's z axis) that a pixel's step along the line changes at a point on the
/// light sheet of one boundary: z^2 / (f b) for parallel axes, generally from the sheet's normal n and the
/// ray r (z r lies on it): dz/dx = -z (n . dr/dx) / (n . r). Lens distortion changes this by its own few per
/// cent and is left out. Constant; any thread.
class DepthSlope {
 public:
  explicit DepthSlope(const Rig& rig);
  /// `position` in metres in the camera's frame, z > 0. Not negative, never infinite.
  float metres_per_px(const Vec3f& position) const;

 private:
  std::array<float, 9> rotation_;
  std::array<float, 3> translation_;
  float per_fx_;
};

}  // namespace relievo
