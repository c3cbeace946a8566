// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/depth_sigma.h"

#include <algorithm>
#include <cmath>

#include "base/variants.h"
#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

constexpr float kLeast = 1e-6F;  // a ray in the sheet itself tells nothing of depth

/// metres_per_px(), of eight positions.
RELIEVO_INLINE void sigmas_body(const DepthSlopeRig& rig, const DepthSlope::Positions& positions,
                                const float* sigma_px, int count, float* out) {
  const auto& r = rig.rotation;
  const Eight none{};
  const Eight least = none + kLeast;
  for (int b = 0; b < count; b += 8) {
    Eight px, py, pz, sigma;
    load(positions.x + b, px);
    load(positions.y + b, py);
    load(positions.z + b, pz);
    load(sigma_px + b, sigma);
    const Eight qx = r[0] * px + r[1] * py + r[2] * pz + rig.translation[0];
    const Eight qz = r[6] * px + r[7] * py + r[8] * pz + rig.translation[2];
    const Eight x = qx / qz;
    const Eight nx = r[0] - x * r[6];
    const Eight ny = r[1] - x * r[7];
    const Eight nz = r[2] - x * r[8];
    const Eight along_ray = nx * px + ny * py + nz * pz;
    const Eight size = along_ray < 0 ? -along_ray : along_ray;
    const Eight step = pz * pz * nx * rig.per_fx;
    const Eight slope = (step <= 0 ? none - step : step) / (size < least ? least : size);
    store(sigma > 0 ? sigma * slope : none, out + b);
  }
}

void sigmas_portable(const DepthSlopeRig& rig, const DepthSlope::Positions& positions, const float* sigma_px,
                     int count, float* out) {
  sigmas_body(rig, positions, sigma_px, count, out);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void sigmas_avx2(const DepthSlopeRig& rig, const DepthSlope::Positions& positions,
                                         const float* sigma_px, int count, float* out) {
  sigmas_body(rig, positions, sigma_px, count, out);
}
#endif

}  // namespace

const std::vector<DepthSigmaKernels>& all_depth_sigma_kernels() {
  const DepthSigmaKernels portable{"portable", sigmas_portable};
#if defined(__x86_64__)
  static const auto kernels = variants(portable, {"avx2", sigmas_avx2});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

void DepthSlope::sigmas_m(const Positions& positions, const float* sigma_px, int count, float* out) const {
  all_depth_sigma_kernels().back().sigmas_m(rig_, positions, sigma_px, count, out);
}

DepthSlope::DepthSlope(const Rig& rig) {
  rig_.per_fx = static_cast<float>(1 / rig.camera.fx());
  for (std::size_t i = 0; i < 9; ++i)
    rig_.rotation[i] = static_cast<float>(rig.projector_from_camera_rotation[i]);
  for (std::size_t i = 0; i < 3; ++i)
    rig_.translation[i] = static_cast<float>(rig.projector_from_camera_translation[i]);
}

float DepthSlope::metres_per_px(const Vec3f& p) const {
  const auto& r = rig_.rotation;
  const float qx = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + rig_.translation[0];
  const float qz = r[6] * p[0] + r[7] * p[1] + r[8] * p[2] + rig_.translation[2];
  const float x = qx / qz;  // the sheet is X = x Z in the projector's frame, its normal (1, 0, -x)
  const float nx = r[0] - x * r[6];
  const float ny = r[1] - x * r[7];
  const float nz = r[2] - x * r[8];
  const float along_ray = nx * p[0] + ny * p[1] + nz * p[2];  // n . r z
  return std::fabs(p[2] * p[2] * nx * rig_.per_fx) / std::max(std::fabs(along_ray), kLeast);
}

}  // namespace relievo
