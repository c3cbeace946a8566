// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/compare_rigs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "capture/calibrate/ray_pairs.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr int kGrid = 24;

double focal(const PinholeModel& a, const PinholeModel& b) {
  return std::max(std::fabs(a.fx() / b.fx() - 1), std::fabs(a.fy() / b.fy() - 1));
}

double centre(const PinholeModel& a, const PinholeModel& b) {
  return std::hypot(a.cx() - b.cx(), a.cy() - b.cy());
}

double angle_between(const std::array<double, 9>& a, const std::array<double, 9>& b) {
  double trace = 0;
  for (std::size_t i = 0; i < 9; ++i) trace += a[i] * b[i];
  return std::acos(std::clamp((trace - 1) / 2, -1.0, 1.0));
}

std::vector<std::string> other_scanning(const Rig& rig, const Rig& reference) {
  std::vector<std::string> out;
  const auto differs = [&](const std::string& what, std::string_view own, std::string_view there) {
    out.push_back(what + ": " + std::string(own) + ", not " + std::string(there));
  };
  if (rig.scan != reference.scan) differs("scan", to_string(rig.scan), to_string(reference.scan));
  if (rig.scan == reference.scan && rig.scan == Scan::kInterlaced && rig.field_order != reference.field_order)
    differs("field order", to_string(rig.field_order), to_string(reference.field_order));
  constexpr double kSame = 1e-4;  // 29.97 is said of 30000 / 1001
  if (std::fabs(rig.frame_rate - reference.frame_rate) > kSame * reference.frame_rate) {
    char text[64];
    std::snprintf(text, sizeof text, "frame rate: %.6g, not %.6g", rig.frame_rate, reference.frame_rate);
    out.emplace_back(text);
  }
  return out;
}

}  // namespace

Result<RigDifference> compare_rigs(const Rig& rig, const Rig& reference, double distance_m) {
  if (rig.camera.width != reference.camera.width || rig.camera.height != reference.camera.height ||
      rig.projector.width != reference.projector.width ||
      rig.projector.height != reference.projector.height) {
    return Error{"the rigs' cameras or projectors differ in size"};
  }
  RigDifference out;
  out.scanning = other_scanning(rig, reference);
  out.camera_focal = focal(rig.camera, reference.camera);
  out.projector_focal = focal(rig.projector, reference.projector);
  out.camera_centre_px = centre(rig.camera, reference.camera);
  out.projector_centre_px = centre(rig.projector, reference.projector);
  out.rotation_rad =
      angle_between(rig.projector_from_camera_rotation, reference.projector_from_camera_rotation);
  const auto& t = rig.projector_from_camera_translation;
  const auto& s = reference.projector_from_camera_translation;
  out.baseline_m = std::hypot(t[0] - s[0], t[1] - s[1], t[2] - s[2]);

  int points = 0;
  const auto& r = reference.projector_from_camera_rotation;
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      const double x = (i + 0.5) / kGrid * reference.camera.width,
                   y = (j + 0.5) / kGrid * reference.camera.height;
      const auto ray = undistort(reference.camera, x, y);
      const auto own_ray = undistort(rig.camera, x, y);
      if (!ray || !own_ray) continue;
      const std::array<double, 3> at = {(*ray)[0] * distance_m, (*ray)[1] * distance_m, distance_m};
      const auto in = [&](std::size_t k) {
        return r[3 * k] * at[0] + r[3 * k + 1] * at[1] + r[3 * k + 2] * at[2] + s[k];
      };
      const auto pixel = distort(reference.projector, in(0) / in(2), in(1) / in(2));
      if (!(pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] <= reference.projector.width - 1 &&
            pixel[1] <= reference.projector.height - 1)) {
        continue;
      }
      const auto own_pixel = undistort(rig.projector, pixel[0], pixel[1]);
      const auto meeting = own_pixel ? meet(rig, *own_ray, *own_pixel) : std::nullopt;
      if (!meeting) continue;
      const double off = double{meeting->point[2]} - distance_m;
      out.depth_rms_m += off * off;
      out.depth_mean_m += off;
      ++points;
    }
  }
  if (points == 0) return Error{"the rigs see nothing in common at that distance"};
  out.depth_rms_m = std::sqrt(out.depth_rms_m / points);
  out.depth_mean_m /= points;
  return out;
}

}  // namespace relievo
