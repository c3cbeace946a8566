// SPDX-License-Identifier: Apache-2.0
// Triangles, lines and points on a grid of samples with a depth each. Pure.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace relievo {

/// Pixels (the centre of the first is (0, 0)) and distance along the view's axis, metres.
struct ScreenPoint {
  float x = 0, y = 0;
  float z = 0;  // not positive: behind the eye; nothing with such a point is drawn
};

class DepthBuffer {
 public:
  DepthBuffer(int width, int height)
      : width_(width),
        height_(height),
        nearness_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  /// True where nothing nearer is there; it is then.
  bool take(int x, int y, float nearness) {
    float& there = nearness_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                             static_cast<std::size_t>(x)];
    if (nearness <= there) return false;
    there = nearness;
    return true;
  }

  /// paint(x, y, weights) for each sample of the triangle that is visible so far; `weights` of its corners,
  /// in space.
  template <typename Paint>
  void triangle(const std::array<ScreenPoint, 3>& p, const Paint& paint) {
    for (const ScreenPoint& corner : p)
      if (!(corner.z > 0)) return;
    const float area = edge(p[0], p[1], p[2].x, p[2].y);
    if (area == 0 || !std::isfinite(area)) return;
    const auto [left, right] = span({p[0].x, p[1].x, p[2].x}, width_);
    const auto [top, bottom] = span({p[0].y, p[1].y, p[2].y}, height_);
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) {
        const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
        const float a = edge(p[1], p[2], fx, fy) / area, b = edge(p[2], p[0], fx, fy) / area, c = 1 - a - b;
        if (a < 0 || b < 0 || c < 0) continue;
        const float wa = a / p[0].z, wb = b / p[1].z, wc = c / p[2].z;
        const float nearness = wa + wb + wc;
        if (take(x, y, nearness)) paint(x, y, std::array{wa / nearness, wb / nearness, wc / nearness});
      }
    }
  }

  /// paint(x, y) for each sample of a line that nothing covers but the surface it lies on.
  template <typename Paint>
  void line(const ScreenPoint& from, const ScreenPoint& to, const Paint& paint) {
    if (!(from.z > 0) || !(to.z > 0)) return;
    const float length = std::max(std::abs(to.x - from.x), std::abs(to.y - from.y));
    if (!(length < static_cast<float>(4 * (width_ + height_)))) return;
    const int steps = std::max(1, static_cast<int>(std::ceil(length)));
    for (int i = 0; i <= steps; ++i) {
      const float t = static_cast<float>(i) / static_cast<float>(steps);
      dot({from.x + t * (to.x - from.x), from.y + t * (to.y - from.y), 1 / ((1 - t) / from.z + t / to.z)}, 1,
          paint);
    }
  }

  /// paint(x, y) for each sample of a square of that many.
  template <typename Paint>
  void dot(const ScreenPoint& at, int size, const Paint& paint) {
    constexpr float kLift = 1.002F;  // off the surface it lies on
    if (!(at.z > 0) || !(std::abs(at.x) < 1e6F) || !(std::abs(at.y) < 1e6F)) return;
    const int left = static_cast<int>(std::lround(at.x - static_cast<float>(size - 1) / 2));
    const int top = static_cast<int>(std::lround(at.y - static_cast<float>(size - 1) / 2));
    for (int y = std::max(top, 0); y < std::min(top + size, height_); ++y)
      for (int x = std::max(left, 0); x < std::min(left + size, width_); ++x)
        if (take(x, y, kLift / at.z)) paint(x, y);
  }

 private:
  static float edge(const ScreenPoint& a, const ScreenPoint& b, float x, float y) {
    return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
  }
  static std::array<int, 2> span(std::array<float, 3> values, int size) {
    const auto [least, most] = std::minmax({values[0], values[1], values[2]});
    const auto limit = static_cast<float>(size);
    return {static_cast<int>(std::ceil(std::clamp(least, 0.0F, limit))),
            static_cast<int>(std::floor(std::clamp(most, -1.0F, limit - 1)))};
  }

  int width_, height_;
  std::vector<float> nearness_;  // 1/z; 0: nothing there
};

}  // namespace relievo
