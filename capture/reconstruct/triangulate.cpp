// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/triangulate.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

constexpr int kSheetSamples = 65;  // over the projector's height and a quarter beyond
constexpr int kSheetRounds = 4;    // of point -> row -> sheet; each gains about two digits

}  // namespace

Triangulator::Triangulator(const Rig& rig, const Pattern& pattern, int lines, int line_step_px)
    : rotation_(rig.projector_from_camera_rotation), translation_(rig.projector_from_camera_translation) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  ray_samples_ = (rig.camera.width + kRayStep - 1) / kRayStep + 1;
  rays_.reserve(static_cast<std::size_t>(lines) * static_cast<std::size_t>(ray_samples_));
  for (int line = 0; line < lines; ++line) {
    for (int s = 0; s < ray_samples_; ++s) {
      const auto p = undistort(rig.camera, s * kRayStep, line * line_step_px);
      rays_.push_back(p ? std::array{static_cast<float>((*p)[0]), static_cast<float>((*p)[1])}
                        : std::array{kNone, kNone});
    }
  }

  const PinholeModel& projector = rig.projector;
  straight_sheets_ = !distorts(projector) && projector.matrix[1] == 0;
  sheet_samples_ = straight_sheets_ ? 1 : kSheetSamples;
  const double top = (0 - projector.cy()) / projector.fy();
  const double bottom = (projector.height - 1 - projector.cy()) / projector.fy();
  const double margin = (bottom - top) / 4;
  sheet_first_ = top - margin;
  sheet_step_ = (bottom - top + 2 * margin) / (kSheetSamples - 1);
  sheets_.reserve(static_cast<std::size_t>(pattern.boundaries()) * static_cast<std::size_t>(sheet_samples_));
  for (int b = 0; b < pattern.boundaries(); ++b) {
    const double target = (pattern.boundary_column_px(b, projector.width) - projector.cx()) / projector.fx();
    for (int s = 0; s < sheet_samples_; ++s) {
      const double y = sheet_first_ + s * sheet_step_;
      sheets_.push_back(
          static_cast<float>(straight_sheets_ ? target : sheet_at(projector.distortion, target, y)));
    }
  }
  sheets_.insert(sheets_.end(), 8, kNone);
}

std::array<float, 2> Triangulator::ray(int line, float column_px) const {
  const float at = column_px / kRayStep;
  const int i = std::clamp(static_cast<int>(at), 0, ray_samples_ - 2);
  const float f = at - static_cast<float>(i);
  const auto* p = rays_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(ray_samples_) + i;
  return {p[0][0] + f * (p[1][0] - p[0][0]), p[0][1] + f * (p[1][1] - p[0][1])};
}

double Triangulator::sheet(int boundary, double y) const {
  const float* samples =
      sheets_.data() + static_cast<std::size_t>(boundary) * static_cast<std::size_t>(sheet_samples_);
  if (straight_sheets_) return samples[0];
  const double at = std::clamp((y - sheet_first_) / sheet_step_, 0.0, kSheetSamples - 1.001);
  const int i = static_cast<int>(at);
  return samples[i] + (at - i) * (samples[i + 1] - samples[i]);
}

bool Triangulator::find(int boundary, float beyond, int line, float column_px, Vec3f& out) const {
  const auto [rx, ry] = ray(line, column_px);
  const auto& r = rotation_;
  // Direction of the ray in the projector's frame; the point is z * d + translation.
  const double dx = r[0] * rx + r[1] * ry + r[2];
  const double dy = r[3] * rx + r[4] * ry + r[5];
  const double dz = r[6] * rx + r[7] * ry + r[8];
  double y = 0;
  double z = 0;
  for (int round = 0; round < (straight_sheets_ ? 1 : kSheetRounds); ++round) {
    double x = sheet(boundary, y);
    if (beyond != 0) x += beyond * (sheet(boundary + 1, y) - x);
    // On the sheet: X = x Z in the projector's frame.
    const double denominator = dx - x * dz;
    if (std::fabs(denominator) < kLeastCrossing) return false;
    z = (x * translation_[2] - translation_[0]) / denominator;
    const double depth = z * dz + translation_[2];
    if (!(z > 0) || !(depth > 0)) return false;  // also where ray or sheet is none (NaN)
    y = (z * dy + translation_[1]) / depth;
  }
  out = {static_cast<float>(z * rx), static_cast<float>(z * ry), static_cast<float>(z)};
  return true;
}

PointCounts Triangulator::place_line(int line, DecodedGrid& grid) const {
  float* column_px = grid.column_px(line);
  const PointRow to = grid.points(line);
  if (straight_sheets_) {
    const auto* rays = rays_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(ray_samples_);
    const auto& r = rotation_;
    return triangulate_kernels().straight({.rays = rays->data(),
                                           .ray_samples = ray_samples_,
                                           .sheets = sheets_.data(),
                                           .across = {r[0], r[1], r[2]},
                                           .forward = {r[6], r[7], r[8]},
                                           .translation_x = translation_[0],
                                           .translation_z = translation_[2]},
                                          grid.boundaries(), column_px, to);
  }
  PointCounts counts;
  for (int b = 0; b < grid.boundaries(); ++b) {
    const bool known = column_px[b] == column_px[b];
    Vec3f point{kNoColumn, kNoColumn, kNoColumn};
    if (known && find(b, 0, line, column_px[b], point)) {
      ++counts.points;
    } else {
      counts.no_point += known;
      column_px[b] = kNoColumn;
    }
    to.x[b] = point[0];
    to.y[b] = point[1];
    to.z[b] = point[2];
  }
  return counts;
}

}  // namespace relievo
