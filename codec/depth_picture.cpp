// SPDX-License-Identifier: Apache-2.0
#include "codec/depth_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/lens.h"

namespace relievo {
namespace {

constexpr double kNearest_m = 1e-6;  // of a vertex before the camera
constexpr double kNothing = std::numeric_limits<double>::infinity();

int first(double lowest) {
  return static_cast<int>(std::ceil(std::clamp(lowest, 0.0, 1e9)));
}
int last(double highest, int count) {
  return static_cast<int>(std::floor(std::clamp(highest, -1.0, count - 1.0)));
}

}  // namespace

DepthPicture::DepthPicture(const PinholeModel& camera)
    : camera_(camera),
      z_m_(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), kNothing) {}

void DepthPicture::clear() {
  std::ranges::fill(z_m_, kNothing);
}

void DepthPicture::draw(const Surface& surface) {
  corners_.clear();
  corners_.reserve(surface.positions.size());
  for (const Vec3f& p : surface.positions) corners_.push_back(seen(p));
  for (const Triangle& t : surface.triangles) draw(corners_[t[0]], corners_[t[1]], corners_[t[2]]);
}

DepthPicture::Corner DepthPicture::seen(const Vec3f& p) const {
  const double z = static_cast<double>(p[2]);
  if (!(z > kNearest_m)) return {0, 0, -1};
  const auto [column, row] = distort(camera_, static_cast<double>(p[0]) / z, static_cast<double>(p[1]) / z);
  return {column, row, 1 / z};
}

/// 1/z is linear in a pinhole's picture.
void DepthPicture::draw(const Corner& a, const Corner& b, const Corner& c) {
  if (std::min({a.inverse_z, b.inverse_z, c.inverse_z}) <= 0) return;
  const double area = (b.column - a.column) * (c.row - a.row) - (c.column - a.column) * (b.row - a.row);
  if (area == 0 || !std::isfinite(area)) return;
  const int first_row = first(std::min({a.row, b.row, c.row}));
  const int last_row = last(std::max({a.row, b.row, c.row}), camera_.height);
  const int first_column = first(std::min({a.column, b.column, c.column}));
  const int last_column = last(std::max({a.column, b.column, c.column}), camera_.width);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      const double wb =
          ((column - a.column) * (c.row - a.row) - (c.column - a.column) * (row - a.row)) / area;
      const double wc =
          ((b.column - a.column) * (row - a.row) - (column - a.column) * (b.row - a.row)) / area;
      if (wb < 0 || wc < 0 || wb + wc > 1) continue;
      const double z =
          1 / (a.inverse_z + wb * (b.inverse_z - a.inverse_z) + wc * (c.inverse_z - a.inverse_z));
      double& nearest = z_m_[static_cast<std::size_t>(row) * static_cast<std::size_t>(camera_.width) +
                             static_cast<std::size_t>(column)];
      nearest = std::min(nearest, z);
    }
  }
}

}  // namespace relievo
