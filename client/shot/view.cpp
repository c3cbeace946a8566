// SPDX-License-Identifier: Apache-2.0
#include "client/shot/view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace relievo {
namespace {

constexpr double kMargin = 1.1;
constexpr double kStray = 0.01;  // share of the vertices at each end

float dot(const Vec3f& a, const Vec3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double radians(double degrees) {
  return degrees * std::numbers::pi / 180;
}

}  // namespace

Vec3f ShotView::to_view(const Vec3f& point) const {
  return direction_to_view({point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]});
}

Vec3f ShotView::direction_to_view(const Vec3f& d) const {
  return {dot(axes[0], d), dot(axes[1], d), dot(axes[2], d)};
}

Extent extent_of(const std::vector<Vec3f>& positions) {
  Extent extent;
  std::vector<float> values;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    values.clear();
    for (const Vec3f& p : positions)
      if (std::isfinite(p[axis])) values.push_back(p[axis]);
    if (values.empty()) continue;
    const auto at = [&](double share) {
      const auto nth = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), nth, values.end());
      return *nth;
    };
    extent.min[axis] = at(kStray);
    extent.max[axis] = at(1 - kStray);
  }
  return extent;
}

ShotView orbit_view(const Extent& extent, const Orbit& orbit, int width, int height) {
  const double azimuth = radians(orbit.azimuth_deg), elevation = radians(orbit.elevation_deg);
  const double tangent = std::tan(radians(orbit.fov_deg) / 2);
  const double aspect = static_cast<double>(width) / height;
  const auto real = [](double a, double b, double c) {
    return Vec3f{static_cast<float>(a), static_cast<float>(b), static_cast<float>(c)};
  };
  ShotView view;
  view.axes = {real(std::cos(azimuth), 0, std::sin(azimuth)),
               real(std::sin(elevation) * std::sin(azimuth), std::cos(elevation),
                    -std::sin(elevation) * std::cos(azimuth)),
               real(-std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                    std::cos(elevation) * std::cos(azimuth))};

  // As far from the middle as all corners need.
  Vec3f middle{};
  for (std::size_t i = 0; i < 3; ++i) middle[i] = (extent.min[i] + extent.max[i]) / 2;
  double distance = 1e-3;
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = [&](std::size_t i) {
      return ((corner >> i & 1) != 0 ? extent.max[i] : extent.min[i]) - middle[i];
    };
    const Vec3f p = view.direction_to_view({at(0), at(1), at(2)});
    const double away = kMargin * std::max(std::abs(p[1]) / tangent, std::abs(p[0]) / (tangent * aspect));
    distance = std::max(distance, away - p[2]);
  }
  distance /= orbit.zoom;
  for (std::size_t i = 0; i < 3; ++i)
    view.eye[i] = middle[i] - static_cast<float>(distance) * view.axes[2][i];

  view.lens.width = width;
  view.lens.height = height;
  const double focal = height / (2 * tangent);
  view.lens.matrix = {focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1};
  return view;
}

ShotView rig_view(const PinholeModel& camera, int width, int height) {
  const double scale =
      std::min(static_cast<double>(width) / camera.width, static_cast<double>(height) / camera.height);
  const double left = (width - scale * camera.width) / 2, top = (height - scale * camera.height) / 2;
  ShotView view;
  view.lens = camera;
  view.lens.width = width;
  view.lens.height = height;
  // Edges of pixels are half a pixel from their centres, at any scale.
  view.lens.matrix = {camera.fx() * scale,
                      0,
                      (camera.cx() + 0.5) * scale + left - 0.5,
                      0,
                      camera.fy() * scale,
                      (camera.cy() + 0.5) * scale + top - 0.5,
                      0,
                      0,
                      1};
  return view;
}

}  // namespace relievo
