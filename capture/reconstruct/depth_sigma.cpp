// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/depth_sigma.h"

#include <algorithm>
#include <cmath>

namespace relievo {

DepthSlope::DepthSlope(const Rig& rig) : per_fx_(static_cast<float>(1 / rig.camera.fx())) {
  for (std::size_t i = 0; i < 9; ++i)
    rotation_[i] = static_cast<float>(rig.projector_from_camera_rotation[i]);
  for (std::size_t i = 0; i < 3; ++i)
    translation_[i] = static_cast<float>(rig.projector_from_camera_translation[i]);
}

float DepthSlope::metres_per_px(const Vec3f& p) const {
  const auto& r = rotation_;
  const float qx = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + translation_[0];
  const float qz = r[6] * p[0] + r[7] * p[1] + r[8] * p[2] + translation_[2];
  const float x = qx / qz;  // the sheet is X = x Z in the projector's frame, its normal (1, 0, -x)
  const float nx = r[0] - x * r[6];
  const float ny = r[1] - x * r[7];
  const float nz = r[2] - x * r[8];
  const float along_ray = nx * p[0] + ny * p[1] + nz * p[2];  // n . r z
  constexpr float kLeast = 1e-6F;  // a ray in the sheet itself tells nothing of depth
  return std::fabs(p[2] * p[2] * nx * per_fx_) / std::max(std::fabs(along_ray), kLeast);
}

}  // namespace relievo
