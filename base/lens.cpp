// SPDX-License-Identifier: Apache-2.0
#include "base/lens.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

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

}  // namespace

PinholeModel resized(const PinholeModel& model, int width, int height) {
  const double across = static_cast<double>(width) / model.width;
  const double down = static_cast<double>(height) / model.height;
  PinholeModel out = model;
  out.width = width;
  out.height = height;
  out.matrix[0] *= across;
  out.matrix[1] *= across;
  out.matrix[2] = (model.cx() + 0.5) * across - 0.5;
  out.matrix[4] *= down;
  out.matrix[5] = (model.cy() + 0.5) * down - 0.5;
  return out;
}

bool distorts(const PinholeModel& model) {
  return std::any_of(model.distortion.begin(), model.distortion.end(), [](double k) { return k != 0; });
}

double sheet_at(const std::array<double, 5>& k, double target, double y) {
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

}  // namespace relievo
