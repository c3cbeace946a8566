// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/triangulate.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

constexpr int kRayStep = 8;        // columns between ray samples: linear between them is good to 1e-3 px
constexpr int kSheetSamples = 65;  // over the projector's height and a quarter beyond
constexpr int kSheetRounds = 4;    // of point -> row -> sheet; each gains about two digits

struct Distorted {
  double x, y;            // distorted normalised coordinates
  double xx, xy, yx, yy;  // their derivatives by the undistorted ones
};

Distorted distort_normalised(const std::array<double, 5>& k, double x, double y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);  // d radial / d r2
  Distorted d{};
  d.x = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  d.y = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
  d.xx = radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x;
  d.xy = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y;
  d.yx = d.xy;
  d.yy = radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x;
  return d;
}

/// Whether a lens images (x, y): the model does not fold over on the way there from the centre. Beyond a fold
/// the polynomial may rise again, to places Newton's method finds as readily as the right one.
bool imaged(const std::array<double, 5>& k, double x, double y) {
  constexpr int kSteps = 8;
  for (int i = 1; i <= kSteps; ++i) {
    const Distorted d = distort_normalised(k, x * i / kSteps, y * i / kSteps);
    if (!(d.xx * d.yy - d.xy * d.yx > 1e-3)) return false;
  }
  return true;
}

bool has_distortion(const PinholeModel& model) {
  return std::any_of(model.distortion.begin(), model.distortion.end(), [](double k) { return k != 0; });
}

/// x/z at which the sheet through projector column `target` (normalised) crosses height y/z = y.
double sheet_x(const std::array<double, 5>& k, double target, double y) {
  double x = target;
  for (int i = 0; i < 20; ++i) {
    const Distorted d = distort_normalised(k, x, y);
    if (!(d.xx > 0.05)) return std::numeric_limits<double>::quiet_NaN();  // the model has folded over
    const double step = (d.x - target) / d.xx;
    x -= step;
    if (std::fabs(step) < 1e-12) break;
  }
  return imaged(k, x, y) ? x : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

std::array<double, 2> distort(const PinholeModel& model, double x, double y) {
  const Distorted d = distort_normalised(model.distortion, x, y);
  return {model.fx() * d.x + model.matrix[1] * d.y + model.cx(), model.fy() * d.y + model.cy()};
}

std::optional<std::array<double, 2>> undistort(const PinholeModel& model, double column_px, double row_px) {
  const double ty = (row_px - model.cy()) / model.fy();
  const double tx = (column_px - model.cx() - model.matrix[1] * ty) / model.fx();
  double x = tx;
  double y = ty;
  for (int i = 0; i < 30; ++i) {
    const Distorted d = distort_normalised(model.distortion, x, y);
    const double det = d.xx * d.yy - d.xy * d.yx;
    if (!(det > 1e-3)) return std::nullopt;
    const double ex = d.x - tx;
    const double ey = d.y - ty;
    const double sx = (d.yy * ex - d.xy * ey) / det;
    const double sy = (d.xx * ey - d.yx * ex) / det;
    x -= sx;
    y -= sy;
    if (std::fabs(sx) + std::fabs(sy) < 1e-12) {
      if (!imaged(model.distortion, x, y)) return std::nullopt;
      return std::array{x, y};
    }
  }
  return std::nullopt;
}

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
  straight_sheets_ = !has_distortion(projector) && projector.matrix[1] == 0;
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
          static_cast<float>(straight_sheets_ ? target : sheet_x(projector.distortion, target, y)));
    }
  }
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

std::optional<Vec3f> Triangulator::point(int boundary, float beyond, int line, float column_px) const {
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
    if (std::fabs(denominator) < 1e-9) return std::nullopt;
    z = (x * translation_[2] - translation_[0]) / denominator;
    const double depth = z * dz + translation_[2];
    if (!(z > 0) || !(depth > 0)) return std::nullopt;  // also where ray or sheet is none (NaN)
    y = (z * dy + translation_[1]) / depth;
  }
  return Vec3f{static_cast<float>(z * rx), static_cast<float>(z * ry), static_cast<float>(z)};
}

}  // namespace relievo
