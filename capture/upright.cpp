// SPDX-License-Identifier: Apache-2.0
#include "capture/upright.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace relievo {
namespace {

/// By 180 degrees about its axis, as a picture of width x height is turned with it.
PinholeModel turned(PinholeModel lens) {
  lens.matrix[2] = lens.width - 1 - lens.cx();
  lens.matrix[5] = lens.height - 1 - lens.cy();
  lens.distortion[2] = -lens.distortion[2];  // p1, p2: what is not alike all around
  lens.distortion[3] = -lens.distortion[3];
  return lens;
}

constexpr double kLeastAcross = 0.05;  // of the baseline: with less a boundary's place hardly tells its depth

/// What of a rig lets lines show codes, and codes depths.
Status check_stripes(const Rig& rig) {
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  // How fast the projector's columns go by along the camera's line, and across lines.
  const double along = std::abs(r[0]), across = std::abs(r[1]);
  if (across >= along) {
    const double degrees = std::atan2(across, along) * 180 / std::numbers::pi;
    return Error{
        "the rig's projector is turned by " + std::to_string(std::lround(degrees)) +
        " degrees against the camera (projector_from_camera_rotation), so that stripes run along the "
        "camera's lines, which then show no code: turn the camera or the projector by 90 degrees and "
        "calibrate again"};
  }
  // How the column of a point on the camera's axis changes with its depth.
  const double baseline = std::hypot(t[0], t[1], t[2]);
  if (std::abs(r[2] * t[2] - r[8] * t[0]) < kLeastAcross * baseline) {
    return Error{
        "the rig's projector stands above, below or behind the camera (projector_from_camera_translation), "
        "along its stripes, which then show no depth: put it beside the camera, or both on their sides, and "
        "calibrate again"};
  }
  return {};
}

}  // namespace

Pattern reversed(const Pattern& pattern) {
  Pattern out = pattern;
  std::reverse(out.sequence.begin(), out.sequence.end());
  return out;
}

Result<UprightRig> upright(const Rig& rig, const Pattern& pattern) {
  if (const Status works = check_stripes(rig); !works) return works.error();
  if (rig.projector_from_camera_rotation[0] > 0) return UprightRig{rig, pattern};
  UprightRig out{rig, reversed(pattern)};
  out.rig.projector = turned(rig.projector);
  for (std::size_t i = 0; i < 6; ++i) out.rig.projector_from_camera_rotation[i] *= -1;  // x and y
  for (std::size_t i = 0; i < 2; ++i) out.rig.projector_from_camera_translation[i] *= -1;
  return out;
}

}  // namespace relievo
