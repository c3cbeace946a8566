// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/cylinder_map.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace relievo::sim {
namespace {

constexpr float kLeastStep = 8e-4f;  // metres; below it nothing on a face is missed

/// A stand-in for the angle of (x, z) that needs no arc tangent: -2 .. 2 once around, 0 at the front (-z), -1
/// and 1 at the sides. Monotonic in the angle and smooth enough to interpolate over.
inline float turn_of(float x, float z) {
  const float part = x / (std::abs(x) + std::abs(z));
  return z <= 0 ? part : std::copysign(2.0f, x) - part;
}

float turn_of_angle(float angle) {
  return turn_of(std::sin(angle), -std::cos(angle));
}

class Surface final : public Shape {
 public:
  Surface(const Pose& pose, std::shared_ptr<const CylinderMap> map)
      : pose_(pose), map_(std::move(map)), origin_(pose.to_local({})) {
    for (std::size_t i = 0; i < widest_in_.size(); ++i) {
      const auto rows = static_cast<std::size_t>(map_->rows), width = static_cast<std::size_t>(map_->columns);
      const std::size_t first = i * rows / kBands, last = std::min(rows, (i + 1) * rows / kBands + 2);
      const auto at = map_->radius_m.begin();
      widest_in_[i] = *std::max_element(at + static_cast<std::ptrdiff_t>(first * width),
                                        at + static_cast<std::ptrdiff_t>(last * width));
      widest_ = std::max(widest_, widest_in_[i]);
    }
    to_column_ = 0.5f * static_cast<float>(map_->columns - 1) / turn_of_angle(map_->angle_limit);
    centre_column_ = 0.5f * static_cast<float>(map_->columns - 1);
    to_row_ = static_cast<float>(map_->rows - 1) / (map_->bottom_m - map_->top_m);
  }

  bool hit(Vec3 direction, Hit& hit) const override {
    const Vec3 d = pose_.rotation.back(direction);
    float enter, exit;
    if (!span(origin_, d, enter, exit) || enter >= hit.depth) return false;
    const float t = march(origin_, d, std::max(enter, 0.0f), std::min(exit, hit.depth));
    if (!(t > 0 && t < hit.depth)) return false;
    hit.depth = t;
    return true;
  }

  Material material(Vec3 direction, const Hit& hit) const override {
    const Vec3 p = origin_ + pose_.rotation.back(direction) * hit.depth;
    const float column = column_of(p), row = row_of(p);
    const float rho = std::sqrt(p.x * p.x + p.z * p.z), s = p.x / rho, c = -p.z / rho;
    const float turn_per_angle = 1 / ((std::abs(s) + std::abs(c)) * (std::abs(s) + std::abs(c)));
    const float slope_angle =
        (radius(column + 1, row) - radius(column - 1, row)) * 0.5f * to_column_ * turn_per_angle / rho;
    const float slope_y = (radius(column, row + 1) - radius(column, row - 1)) * 0.5f * to_row_;
    const Vec3 n{s - slope_angle * c, -slope_y, -c - slope_angle * s};
    return {unit(pose_.rotation * n), albedo(column, row), map_->gloss};
  }

  bool blocks(Vec3 from, Vec3 light) const override {
    const Vec3 ray = light - from;
    const Vec3 o = pose_.to_local(from), d = pose_.rotation.back(ray);
    float enter, exit;
    if (!span(o, d, enter, exit)) return false;
    const float off = 2.5e-3f / length(ray);  // leaves its own surface first
    enter = std::max(enter, off);
    exit = std::min(exit, 1.0f);
    return enter < exit && march(o, d, enter, exit, 1.0e-3f) > 0;
  }

  Sphere bound() const override {
    const float middle = 0.5f * (map_->top_m + map_->bottom_m), half = 0.5f * (map_->bottom_m - map_->top_m);
    return {pose_.to_camera({0, middle, 0}), std::sqrt(half * half + widest_ * widest_)};
  }

 private:
  float column_of(Vec3 p) const { return turn_of(p.x, p.z) * to_column_ + centre_column_; }
  float row_of(Vec3 p) const { return (p.y - map_->top_m) * to_row_; }

  float radius(float column, float row) const {
    const CylinderMap& m = *map_;
    column = std::clamp(column, 0.0f, static_cast<float>(m.columns) - 1.001f);
    row = std::clamp(row, 0.0f, static_cast<float>(m.rows) - 1.001f);
    const int x = static_cast<int>(column), y = static_cast<int>(row);
    const float u = column - static_cast<float>(x), v = row - static_cast<float>(y);
    const float* a = &m.radius_m[m.at(x, y)];
    const float* b = a + m.columns;
    const float top = a[0] + (a[1] - a[0]) * u, low = b[0] + (b[1] - b[0]) * u;
    return top + (low - top) * v;
  }

  Vec3 albedo(float column, float row) const {
    const CylinderMap& m = *map_;
    column = std::clamp(column, 0.0f, static_cast<float>(m.columns) - 1.001f);
    row = std::clamp(row, 0.0f, static_cast<float>(m.rows) - 1.001f);
    const int x = static_cast<int>(column), y = static_cast<int>(row);
    const Vec3* a = &m.albedo[m.at(x, y)];
    const Vec3* b = a + m.columns;
    const float u = column - static_cast<float>(x);
    return mix(mix(a[0], a[1], u), mix(b[0], b[1], u), row - static_cast<float>(y));
  }

  /// How far p is outside the surface, along the radius.
  float outside(Vec3 p) const { return std::sqrt(p.x * p.x + p.z * p.z) - radius(column_of(p), row_of(p)); }

  /// The part of the ray that may lie within the surface: within its heights and the widest radius of those
  /// that the ray passes.
  bool span(Vec3 o, Vec3 d, float& enter, float& exit) const {
    if (!within(o, d, widest_, enter, exit)) return false;
    const float a = row_of(o + d * enter), b = row_of(o + d * exit);
    const float bands = static_cast<float>(kBands) / static_cast<float>(map_->rows);
    const auto band = [&](float row) {
      return std::clamp(static_cast<int>(row * bands), 0, static_cast<int>(kBands) - 1);
    };
    float widest = 0;
    for (int i = band(std::min(a, b)); i <= band(std::max(a, b)); ++i) {
      widest = std::max(widest, widest_in_[static_cast<std::size_t>(i)]);
    }
    return within(o, d, widest, enter, exit);
  }

  bool within(Vec3 o, Vec3 d, float widest, float& enter, float& exit) const {
    const float a = d.x * d.x + d.z * d.z, b = o.x * d.x + o.z * d.z;
    const float h = b * b - a * (o.x * o.x + o.z * o.z - widest * widest);
    if (!(h > 0) || !(a > 0)) return false;
    const float root = std::sqrt(h);
    enter = (-b - root) / a;
    exit = (-b + root) / a;
    const float inverse = 1 / d.y;
    const float top = (map_->top_m - o.y) * inverse, low = (map_->bottom_m - o.y) * inverse;
    enter = std::max(enter, std::min(top, low));
    exit = std::min(exit, std::max(top, low));
    return enter < exit && exit > 0;
  }

  /// First t in [enter, exit] at which the ray goes below the surface, or -1.
  float march(Vec3 o, Vec3 d, float enter, float exit, float inside = 0) const {
    const float per_metre = 1 / length(d);
    float t = enter, last_t = enter;
    float f = outside(o + d * t) + inside, last_f = f;
    if (f <= 0)
      return inside > 0 ? -1 : t;  // a shadow ray that starts within its allowance: grazing, call it lit
    while (t < exit) {
      last_t = t;
      last_f = f;
      t += std::max(f * (f < 0.006f ? 0.7f : 0.9f), kLeastStep) * per_metre;
      f = outside(o + d * t) + inside;
      if (f > 0) continue;
      if (inside > 0) return t;  // a shadow need not know where
      for (int i = 0; i < 3 && last_f > 1e-5f; ++i) {
        const float middle = last_t + (t - last_t) * last_f / (last_f - f);
        const float g = outside(o + d * middle);
        if (g > 0) {
          last_t = middle;
          last_f = g;
        } else {
          t = middle;
          f = g;
          if (g > -1e-5f) return t;
        }
      }
      return last_t + (t - last_t) * last_f / (last_f - f);
    }
    return -1;
  }

  static constexpr std::size_t kBands = 32;

  Pose pose_;
  std::shared_ptr<const CylinderMap> map_;
  Vec3 origin_;
  std::array<float, kBands> widest_in_{};  // of each band of rows
  float widest_ = 0, to_column_ = 0, centre_column_ = 0, to_row_ = 0;
};

}  // namespace

float CylinderMap::angle(int column) const {
  const float turn =
      turn_of_angle(angle_limit) * (2 * static_cast<float>(column) / static_cast<float>(columns - 1) - 1);
  const float a = std::abs(turn);
  const float angle = a <= 1 ? std::atan2(a, 1 - a) : std::atan2(2 - a, 1 - a);
  return std::copysign(angle, turn);
}

float CylinderMap::column_of(float angle) const {
  return (turn_of_angle(angle) / turn_of_angle(angle_limit) + 1) * 0.5f * static_cast<float>(columns - 1);
}

void CylinderMap::resize(int new_columns, int new_rows) {
  columns = new_columns;
  rows = new_rows;
  radius_m.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
  albedo.assign(radius_m.size(), {});
}

std::shared_ptr<const Shape> make_cylinder_map(const Pose& pose, std::shared_ptr<const CylinderMap> map) {
  return std::make_shared<Surface>(pose, std::move(map));
}

}  // namespace relievo::sim
