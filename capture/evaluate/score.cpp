// SPDX-License-Identifier: Apache-2.0
#include "capture/evaluate/score.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/line_step.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {
namespace {

constexpr float kDepthStep = 0.01F;     // of depth: neighbouring pixels further apart are on two surfaces
constexpr float kOutlier = 0.02F;       // of depth
constexpr float kShadowSlack = 1.015F;  // of the nearest surface in a projector bin
constexpr int kShadowBin = 2;           // projector pixels
constexpr float kBorder = 8;            // camera columns not looked at

std::size_t at(int row, int column, int width) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
}

}  // namespace

ImageF truth_of_field(const ImageF& truth, int half) {
  ImageF out = truth.clone();
  if (half == 0 || truth.height() < 2) return out;
  for (int y = 0; y < truth.height(); y += 2) {
    const float* above = truth.row(y > 0 ? y - 1 : y + 1);
    const float* below = truth.row(y + 1 < truth.height() ? y + 1 : y - 1);
    const float* own = truth.row(y);
    float* to = out.row(y);
    for (int x = 0; x < truth.width(); ++x) {
      const float a = above[x];
      const float b = below[x];
      // Across a step in depth, the side that the row itself is on.
      to[x] = a > 0 && b > 0 && std::fabs(a - b) < kDepthStep * a ? 0.5F * (a + b)
              : std::fabs(a - own[x]) < std::fabs(b - own[x])     ? a
                                                                  : b;
    }
  }
  return out;
}

ImageF truth_between(const ImageF& before, const ImageF& after) {
  ImageF out = after.clone();
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float a = before.data()[i];
    float& b = out.data()[i];
    if (a > 0 && b > 0 && std::fabs(a - b) < kDepthStep * a) b = 0.5F * (a + b);
  }
  return out;
}

Scorer::Scorer(const Rig& rig, const Pattern& pattern) : rig_(rig), pattern_(pattern) {
  const int width = rig.camera.width;
  const int height = rig.camera.height;
  ray_x_.resize(at(height, 0, width));
  ray_y_.resize(at(height, 0, width));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto ray = undistort(rig.camera, x, y);
      ray_x_[at(y, x, width)] = ray ? static_cast<float>((*ray)[0]) : 0;
      ray_y_[at(y, x, width)] = ray ? static_cast<float>((*ray)[1]) : 0;
    }
  }
}

std::vector<Scorer::Expected> Scorer::expected(const ImageF& truth) const {
  const int width = truth.width();
  const int height = truth.height();
  const PinholeModel& projector = rig_.projector;
  const auto& r = rig_.projector_from_camera_rotation;
  const auto& t = rig_.projector_from_camera_translation;
  const std::size_t pixels = truth.size();
  std::vector<float> stripe(pixels);    // position in stripes, where the projector could light the pixel
  std::vector<float> distance(pixels);  // along the projector's z axis
  std::vector<int> bin(pixels, -1);
  const int bins_x = projector.width / kShadowBin + 1;
  const int bins_y = projector.height / kShadowBin + 1;
  std::vector<float> nearest(static_cast<std::size_t>(bins_x) * static_cast<std::size_t>(bins_y),
                             std::numeric_limits<float>::infinity());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = at(y, x, width);
      const double z = truth.row(y)[x];
      if (!(z > 0)) continue;
      const double px = ray_x_[i] * z;
      const double py = ray_y_[i] * z;
      const double qx = r[0] * px + r[1] * py + r[2] * z + t[0];
      const double qy = r[3] * px + r[4] * py + r[5] * z + t[1];
      const double qz = r[6] * px + r[7] * py + r[8] * z + t[2];
      if (!(qz > 0)) continue;
      const auto [column, row] = distort(projector, qx / qz, qy / qz);
      const double s = (column + 0.5) / projector.width * pattern_.stripes();
      if (!(s >= 0 && s < pattern_.stripes() && row > 0 && row < projector.height - 1)) continue;
      stripe[i] = static_cast<float>(s);
      distance[i] = static_cast<float>(qz);
      const int bx = std::clamp(static_cast<int>(column / kShadowBin), 0, bins_x - 1);
      const int by = std::clamp(static_cast<int>(row / kShadowBin), 0, bins_y - 1);
      bin[i] = by * bins_x + bx;
      float& near = nearest[static_cast<std::size_t>(bin[i])];
      near = std::min(near, distance[i]);
    }
  }
  const auto lit = [&](std::size_t i) {
    return bin[i] >= 0 && distance[i] < nearest[static_cast<std::size_t>(bin[i])] * kShadowSlack;
  };
  std::vector<Expected> out;
  const int step = line_step_px(rig_.scan);
  for (int y = 0; y < height; y += step) {
    const float* z = truth.row(y);
    for (int x = 0; x + 1 < width; ++x) {
      const std::size_t i = at(y, x, width);
      if (!lit(i) || !lit(i + 1) || std::fabs(z[x + 1] - z[x]) >= kDepthStep * z[x + 1]) continue;
      const int left = static_cast<int>(stripe[i]);
      const int right = static_cast<int>(stripe[i + 1]);
      if (std::abs(right - left) != 1) continue;
      const float f = (static_cast<float>(std::max(left, right)) - stripe[i]) / (stripe[i + 1] - stripe[i]);
      const float column = static_cast<float>(x) + std::clamp(f, 0.F, 1.F);
      if (column > kBorder && column < static_cast<float>(width) - kBorder) out.push_back({y, column});
    }
  }
  return out;
}

void Scorer::add(const ImageF& truth, const Surface* surface, Judgement* judgement) {
  const int width = truth.width();
  const int height = truth.height();
  const std::vector<Expected> visible = expected(truth);
  ++of_;
  expected_ += visible.size();
  if (judgement != nullptr) {
    *judgement = {};
    for (const Expected& e : visible) judgement->boundaries.push_back({e.row, e.column_px, false});
  }
  if (surface == nullptr) return;
  ++frames_;
  vertices_ += surface->positions.size();
  std::vector<bool> covered(truth.size());
  for (const Vec3f& p : surface->positions) {
    if (!(p[2] > 0)) continue;
    const auto [column, row] = distort(rig_.camera, p[0] / p[2], p[1] / p[2]);
    const int y = std::clamp(static_cast<int>(std::lround(row)), 0, height - 1);
    const int x = std::clamp(static_cast<int>(std::floor(column)), 0, width - 2);
    const float z0 = truth.row(y)[x];
    const float z1 = truth.row(y)[x + 1];
    float z = std::fabs(z0 - p[2]) < std::fabs(z1 - p[2]) ? z0 : z1;
    if (z0 > 0 && z1 > 0 && std::fabs(z0 - z1) < kDepthStep * std::max(z0, z1)) {
      const float f = std::clamp(static_cast<float>(column) - static_cast<float>(x), 0.F, 1.F);
      z = z0 * (1 - f) + z1 * f;
    }
    const float error = std::fabs(p[2] - z);
    const bool right = z > 0 && error < kOutlier * z;
    if (judgement != nullptr) {
      judgement->vertices.push_back(
          {static_cast<float>(column), static_cast<float>(row), right ? (p[2] - z) / z : 0, right});
    }
    if (!right) continue;
    ++right_;
    errors_.push_back(error / z);
    const int nearest = std::clamp(static_cast<int>(std::lround(column)), 0, width - 1);
    covered[at(y, nearest, width)] = true;
    if (rig_.scan == Scan::kInterlaced && y > 0) covered[at(y - 1, nearest, width)] = true;
  }
  for (std::size_t i = 0; i < visible.size(); ++i) {
    const Expected& e = visible[i];
    const int x = std::clamp(static_cast<int>(std::lround(e.column_px)), 1, width - 2);
    const bool found =
        covered[at(e.row, x - 1, width)] || covered[at(e.row, x, width)] || covered[at(e.row, x + 1, width)];
    hit_ += found;
    if (judgement != nullptr) judgement->boundaries[i].found = found;
  }
}

Score Scorer::score() const {
  Score s;
  s.frames = frames_;
  s.of = of_;
  if (frames_ > 0) s.vertices_per_frame = static_cast<double>(vertices_) / static_cast<double>(frames_);
  if (expected_ > 0) s.completeness = static_cast<double>(hit_) / static_cast<double>(expected_);
  if (vertices_ > 0) s.outliers = 1 - static_cast<double>(right_) / static_cast<double>(vertices_);
  if (errors_.empty()) return s;
  std::vector<float> sorted = errors_;
  std::sort(sorted.begin(), sorted.end());
  const auto quantile = [&](double q) {
    const double place = q * static_cast<double>(sorted.size() - 1);
    const std::size_t i = static_cast<std::size_t>(place);
    const double f = place - static_cast<double>(i);
    return 1e6 * (sorted[i] * (1 - f) + sorted[std::min(i + 1, sorted.size() - 1)] * f);
  };
  s.median_um_per_m = quantile(0.5);
  s.p95_um_per_m = quantile(0.95);
  double sum = 0;
  for (const float e : errors_) sum += static_cast<double>(e) * e;
  s.rms_um_per_m = 1e6 * std::sqrt(sum / static_cast<double>(errors_.size()));
  return s;
}

}  // namespace relievo
