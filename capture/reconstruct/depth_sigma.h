// SPDX-License-Identifier: Apache-2.0
// How exact a point is: from the standard deviation of its column in the picture to that of its depth.
#pragma once

#include <array>
#include <vector>

#include "base/frame3d.h"
#include "base/rig.h"

namespace relievo {

struct DepthSlopeRig {
  std::array<float, 9> rotation;  // projector from camera
  std::array<float, 3> translation;
  float per_fx;
};

/// Metres of depth (along the camera's z axis) that a pixel's step along the line changes at a point on the
/// light sheet of one boundary: z^2 / (f b) for parallel axes, generally from the sheet's normal n and the
/// ray r (z r lies on it): dz/dx = -z (n . dr/dx) / (n . r). Lens distortion changes this by its own few per
/// cent and is left out. Constant; any thread.
class DepthSlope {
 public:
  explicit DepthSlope(const Rig& rig);
  /// `position` in metres in the camera's frame, z > 0. Not negative, never infinite.
  float metres_per_px(const Vec3f& position) const;

  /// Of `count` positions, and up to 7 more of whatever is there: standard deviations of their depths from
  /// those of their columns; 0 where that is not known.
  struct Positions {
    const float *x, *y, *z;
  };
  void sigmas_m(const Positions& positions, const float* sigma_px, int count, float* out) const;

 private:
  DepthSlopeRig rig_;
};

/// One portable implementation of DepthSlope::sigmas_m() and others with the same results.
struct DepthSigmaKernels {
  const char* name;
  void (*sigmas_m)(const DepthSlopeRig& rig, const DepthSlope::Positions& positions, const float* sigma_px,
                   int count, float* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<DepthSigmaKernels>& all_depth_sigma_kernels();

}  // namespace relievo
