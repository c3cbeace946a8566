// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/ray_pairs.h"

#include <cassert>
#include <cmath>

#include "capture/reconstruct/triangulate.h"

namespace relievo {

std::optional<RayMeeting> meet(const Rig& rig, std::array<double, 2> camera,
                               std::array<double, 2> projector) {
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  // In the camera's frame: a camera ray s * u, and a projector ray c + q * v with c = -R't, v = R'(x, y, 1).
  const std::array<double, 3> u = {camera[0], camera[1], 1};
  std::array<double, 3> v{}, c{};
  for (std::size_t i = 0; i < 3; ++i) {
    v[i] = r[i] * projector[0] + r[3 + i] * projector[1] + r[6 + i];
    c[i] = -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]);
  }
  const auto dot = [](const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uc = dot(u, c), vc = dot(v, c);
  const double det = uu * vv - uv * uv;
  if (!(det > 1e-9 * uu * vv)) return std::nullopt;
  const double s = (uc * vv - vc * uv) / det;
  const double q = (uc * uv - vc * uu) / det;
  if (!(s > 0 && q > 0)) return std::nullopt;
  RayMeeting out;
  double gap = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double on_camera = s * u[i], on_projector = c[i] + q * v[i];
    out.point[i] = static_cast<float>((on_camera + on_projector) / 2);
    gap += (on_camera - on_projector) * (on_camera - on_projector);
  }
  out.gap_m = static_cast<float>(std::sqrt(gap));
  return out;
}

DensePoints triangulate_maps(const Rig& rig, const ImageF& columns, const ImageF& rows, const Image8& picture,
                             double max_gap_m) {
  assert(columns.width() == picture.width() && rows.width() == picture.width());
  DensePoints out;
  for (int y = 0; y < columns.height(); ++y) {
    for (int x = 0; x < columns.width(); ++x) {
      const float column = columns.row(y)[x], row = rows.row(y)[x];
      if (column < 0 || row < 0) continue;
      const auto camera = undistort(rig.camera, x, y);
      const auto projector = undistort(rig.projector, column, row);
      const auto meeting = camera && projector ? meet(rig, *camera, *projector) : std::nullopt;
      if (!meeting || (max_gap_m > 0 && meeting->gap_m > max_gap_m)) {
        ++out.apart;
        continue;
      }
      const std::uint8_t* rgb = picture.row(y) + 3 * x;
      out.cloud.positions.push_back(meeting->point);
      out.cloud.colours.push_back({rgb[0], rgb[1], rgb[2]});
      out.gap_m.push_back(meeting->gap_m);
    }
  }
  return out;
}

}  // namespace relievo
