// SPDX-License-Identifier: Apache-2.0
#include "capture/plan/plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numbers>

#include "capture/reconstruct/depth_sigma.h"

namespace relievo {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFusedChannels = 1.8;     // that flip at a boundary, of random neighbours of the palette
constexpr int kNarrowestProjected_px = 4;  // projector pixels: a blurred stripe keeps its colour
constexpr double kWidestStripe_px = 16;    // camera pixels: more only costs resolution
constexpr int kSamples = 257;              // along the middle row
constexpr int kAcross = 25;                // of the whole picture, in each direction
constexpr double kLeastLit = 0.9;

std::string number(double value, int digits) {
  char out[32];
  std::snprintf(out, sizeof out, "%.*f", digits, value);
  return out;
}

/// The camera's and the projector's geometry as straight lines.
class Sight {
 public:
  explicit Sight(const Rig& rig) : rig_(rig) {}

  std::array<double, 3> point(double column_px, double row_px, double depth_m) const {
    return {(column_px - rig_.camera.cx()) / rig_.camera.fx() * depth_m,
            (row_px - rig_.camera.cy()) / rig_.camera.fy() * depth_m, depth_m};
  }

  /// Projector pixel that lights a point; nothing behind the projector.
  std::optional<std::array<double, 2>> projected(const std::array<double, 3>& p) const {
    std::array<double, 3> q{};
    for (std::size_t i = 0; i < 3; ++i) {
      q[i] = rig_.projector_from_camera_translation[i];
      for (std::size_t k = 0; k < 3; ++k) q[i] += rig_.projector_from_camera_rotation[3 * i + k] * p[k];
    }
    if (!(q[2] > 0)) return std::nullopt;
    return std::array{rig_.projector.fx() * q[0] / q[2] + rig_.projector.cx(),
                      rig_.projector.fy() * q[1] / q[2] + rig_.projector.cy()};
  }

  /// Of the projector's columns that one camera column spans on a plane; nothing where it is not lit.
  std::optional<double> columns_per_px(double column_px, double row_px, double depth_m) const {
    constexpr double kStep = 0.5;
    const auto left = projected(point(column_px - kStep, row_px, depth_m));
    const auto right = projected(point(column_px + kStep, row_px, depth_m));
    const auto here = projected(point(column_px, row_px, depth_m));
    if (!left || !right || !here || !in_slide(*here)) return std::nullopt;
    return std::fabs((*right)[0] - (*left)[0]) / (2 * kStep);
  }

  bool in_slide(const std::array<double, 2>& pixel) const {
    return pixel[0] >= -0.5 && pixel[0] <= rig_.projector.width - 0.5 && pixel[1] >= -0.5 &&
           pixel[1] <= rig_.projector.height - 0.5;
  }

  /// Depth at which the camera's middle pixel is lit by this projector column; nothing where their rays do
  /// not meet in front of both.
  std::optional<double> depth_of(double projector_column_px) const {
    const auto& r = rig_.projector_from_camera_rotation;
    const auto& t = rig_.projector_from_camera_translation;
    const double x = (projector_column_px - rig_.projector.cx()) / rig_.projector.fx();
    // The middle pixel's ray is the axis: its direction in the projector's frame is the third column.
    const double depth = (x * t[2] - t[0]) / (r[2] - x * r[8]);
    if (!(depth > 0) || !(depth * r[8] + t[2] > 0)) return std::nullopt;
    return depth;
  }

 private:
  const Rig& rig_;
};

double lit_share(const Rig& rig, const Sight& sight, double depth_m) {
  int lit = 0;
  for (int j = 0; j < kAcross; ++j) {
    for (int i = 0; i < kAcross; ++i) {
      const auto pixel = sight.projected(sight.point((i + 0.5) / kAcross * rig.camera.width - 0.5,
                                                     (j + 0.5) / kAcross * rig.camera.height - 0.5, depth_m));
      lit += pixel && sight.in_slide(*pixel);
    }
  }
  return static_cast<double>(lit) / (kAcross * kAcross);
}

/// Projector columns a camera column, median of the middle row; 0 where nothing is lit.
double columns_per_px(const Rig& rig, const Sight& sight, double depth_m) {
  std::vector<double> all;
  for (int i = 0; i < kSamples; ++i) {
    const double column = i * (rig.camera.width - 1.0) / (kSamples - 1);
    if (const auto c = sight.columns_per_px(column, rig.camera.cy(), depth_m)) all.push_back(*c);
  }
  if (all.empty()) return 0;
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  return *middle;
}

/// Sigma along one direction of the disc of confusion of a thin lens, in its own pixels.
double focus_sigma_px(double focal_px, double aperture_m, double focused_m, double depth_m) {
  const double diameter_px = focal_px * aperture_m * std::fabs(1 / focused_m - 1 / depth_m);
  return diameter_px / 4;
}

/// Standard deviation of a pixel of the calibrated difference of slide and complement.
double difference_noise(const Rig& rig, double noise) {
  double gain = 0;  // mean square of the colour matrix's rows
  for (const double m : rig.colour_matrix) gain += m * m / 3;
  // An interlaced line is set against the mean of the two lines of the other field around it.
  const double exposures = rig.scan == Scan::kInterlaced ? 1.5 : 2;
  return noise * std::sqrt(exposures * gain);
}

/// The least standard deviation of the place of an edge from -level to +level, blurred by a Gaussian, that
/// white noise allows (Cramer-Rao), all channels that flip taken together. Pixels.
double edge_sigma_px(double level, double blur_px, double noise) {
  const double slope = 2 * level / (std::sqrt(2 * kPi) * blur_px);
  return noise / (slope * std::sqrt(std::sqrt(kPi) * blur_px) * std::sqrt(kFusedChannels));
}

PlanAtDepth at_depth(const Rig& rig, const Pattern& pattern, const PlanConditions& c, double depth_m) {
  const Sight sight(rig);
  PlanAtDepth out;
  out.depth_m = depth_m;
  out.view_width_m = depth_m * rig.camera.width / rig.camera.fx();
  out.view_height_m = depth_m * rig.camera.height / rig.camera.fy();
  out.lit = lit_share(rig, sight, depth_m);
  const double columns = columns_per_px(rig, sight, depth_m);
  if (columns <= 0) return out;
  out.stripe_px = static_cast<double>(rig.projector.width) / pattern.stripes() / columns;
  out.stripe_m = out.stripe_px * depth_m / rig.camera.fx();
  const DepthSlope slope(rig);
  out.metres_per_px = static_cast<double>(slope.metres_per_px({0, 0, static_cast<float>(depth_m)}));

  const double field_s = 0.5 / rig.frame_rate;
  const double exposure_s = c.exposure_s > 0 ? c.exposure_s : field_s;
  out.motion_blur_px = rig.camera.fx() * c.speed_m_s * exposure_s / depth_m;
  out.motion_frame_px = c.speed_m_s / rig.frame_rate / out.metres_per_px;
  const double camera_focus = focus_sigma_px(rig.camera.fx(), c.camera_aperture_m, c.distance_m, depth_m);
  const double projector_focus =
      focus_sigma_px(rig.projector.fx(), c.projector_aperture_m, c.distance_m, depth_m) / columns;
  out.focus_blur_px = std::hypot(camera_focus, projector_focus);
  const double pixel = 1 / std::sqrt(12.0);  // a pixel is the mean over its own width
  // A stripe stays where it is on what moves across; only what moves in depth smears it.
  const double smear = c.speed_m_s * exposure_s / out.metres_per_px / std::sqrt(12.0);
  out.blur_px = std::sqrt(c.camera_blur_px * c.camera_blur_px + pixel * pixel + smear * smear +
                          out.focus_blur_px * out.focus_blur_px + std::pow(c.projector_blur_px / columns, 2));
  out.bound_px = edge_sigma_px(c.level, out.blur_px, difference_noise(rig, c.noise));
  out.sigma_px = std::hypot(kSigmaOfBound * out.bound_px, kSigmaFloor_px);
  out.sigma_m = out.sigma_px * out.metres_per_px;
  return out;
}

/// Least distance, in boundaries, at which a run of `run` boundaries looks the same again under one slide.
int nearest_repeat(const Pattern& pattern, int slide, int run) {
  std::map<std::vector<int>, int> last;
  int nearest = std::numeric_limits<int>::max();
  for (int b = 0; b + run <= pattern.boundaries(); ++b) {
    std::vector<int> look;
    for (int i = 0; i <= run; ++i) look.push_back(pattern.digit(b + i, slide));
    const auto [at, fresh] = last.insert({std::move(look), b});
    if (fresh) continue;
    nearest = std::min(nearest, b - at->second);
    at->second = b;
  }
  return nearest;
}

bool codes_are_unique(const Pattern& pattern) {
  std::map<std::array<int, 2>, int> seen;
  for (int b = 0; b < pattern.boundaries(); ++b) {
    const auto i = static_cast<std::size_t>(b);
    if (++seen[{pattern.sequence[i], pattern.sequence[i + 1]}] > 1) return false;
  }
  return true;
}

DepthSpan span_of_one_slide(const Rig& rig, const Pattern& pattern, double distance_m, int run) {
  int nearest = std::numeric_limits<int>::max();
  for (int s = 0; s < pattern.slides; ++s) nearest = std::min(nearest, nearest_repeat(pattern, s, run));
  const Sight sight(rig);
  const auto here = sight.projected({0, 0, distance_m});
  DepthSpan out;
  if (!here || nearest == std::numeric_limits<int>::max()) return out;
  const double columns = static_cast<double>(nearest) * rig.projector.width / pattern.stripes();
  for (const double column : {(*here)[0] - columns, (*here)[0] + columns}) {
    const auto depth = sight.depth_of(column);
    if (!depth) continue;
    if (*depth < distance_m) out.near_m = *depth;
    if (*depth > distance_m) out.far_m = *depth;
  }
  return out;
}

int recommend(const Rig& rig, const Plan& plan, const Pattern& pattern) {
  double columns = 0;  // of the narrowest stripe that the camera tells
  for (const PlanAtDepth& at : plan.at)
    columns = std::max(columns, kNarrowestStripe_px * rig.projector.width / pattern.stripes() / at.stripe_px);
  columns = std::max<double>(columns, kNarrowestProjected_px);
  const int most_codes = static_cast<int>(
      std::min(1e6, std::pow(pattern.base, pattern.slides) * std::pow(pattern.base - 1, pattern.slides)));
  const int most = std::min(static_cast<int>(rig.projector.width / columns + 1e-9), most_codes + 1);
  // Stripes of equal width in whole pixels, where few are lost by it.
  for (int n = most; n >= 0.9 * most && n > 2; --n)
    if (rig.projector.width % n == 0) return n;
  return std::max(2, most);
}

std::string span_text(const PlanAtDepth& at) {
  return number(at.depth_m, 2) + " m";
}

std::vector<std::string> warnings_of(const Rig& rig, const Pattern& pattern, const PlanConditions& c,
                                     const Plan& plan) {
  std::vector<std::string> out;
  const auto [narrowest, widest] = std::minmax_element(
      plan.at.begin(), plan.at.end(), [](const auto& a, const auto& b) { return a.stripe_px < b.stripe_px; });
  const std::string advice = "project about " + std::to_string(plan.recommended_stripes) + " stripes";
  if (narrowest->stripe_px < kNarrowestStripe_px)
    out.push_back("stripes are " + number(narrowest->stripe_px, 1) + " camera pixels wide at " +
                  span_text(*narrowest) + ", below " + number(kNarrowestStripe_px, 0) +
                  " many are lost: " + advice);
  if (widest->stripe_px > kWidestStripe_px)
    out.push_back("stripes are " + number(widest->stripe_px, 1) + " camera pixels wide at " +
                  span_text(*widest) + ", which wastes resolution: " + advice);
  if (rig.projector.width < kNarrowestProjected_px * pattern.stripes())
    out.push_back("stripes are " + number(static_cast<double>(rig.projector.width) / pattern.stripes(), 1) +
                  " projector pixels wide, too few for their colours: " + advice);
  for (const PlanAtDepth& at : plan.at) {
    if (at.lit < kLeastLit)
      out.push_back(
          "at " + span_text(at) + " the projector lights only " + number(100 * at.lit, 0) +
          " % of the camera's view: use a shorter throw, a longer camera lens, or a shorter baseline");
    // Beyond half a stripe, neighbouring colours mix everywhere.
    if (at.blur_px > 0.35 * at.stripe_px)
      out.push_back("at " + span_text(at) + " edges are blurred over " + number(2 * at.blur_px, 1) +
                    " px of stripes " + number(at.stripe_px, 1) +
                    " px wide: focus both lenses at the working distance, stop them down, or project fewer "
                    "stripes");
  }
  const double field_s = 0.5 / rig.frame_rate;
  if (c.exposure_s > field_s * 1.001)
    out.push_back("an exposure of " + number(c.exposure_s * 1e3, 1) + " ms is longer than a field (" +
                  number(field_s * 1e3, 1) + " ms) and mixes two slides: shorten it");
  const PlanAtDepth& near = plan.at[0];
  if (near.motion_frame_px > near.stripe_px)
    out.push_back("motion of " + number(c.speed_m_s, 2) + " m/s in depth moves boundaries by " +
                  number(near.motion_frame_px, 1) +
                  " px a frame, more than a stripe: raise the frame rate, "
                  "project fewer stripes, or use the scheme one-slide");
  if (near.motion_blur_px > near.stripe_px / 2)
    out.push_back("motion of " + number(c.speed_m_s, 2) + " m/s across the picture smears texture over " +
                  number(near.motion_blur_px, 1) + " px: shorten the exposure");
  if (!plan.unique && pattern.scheme != Scheme::kOneSlide)
    out.push_back("some boundary codes repeat: give fewer stripes or a larger base");
  return out;
}

}  // namespace

Result<Rig> sketch_rig(const RigSketch& s) {
  constexpr double kWidest = 170 * kPi / 180;
  if (s.camera_width < 8 || s.camera_height < 8 || s.projector_width < 8 || s.projector_height < 8)
    return Error{"camera and projector need at least 8x8 pixels"};
  if (!(s.camera_view_rad > 0 && s.camera_view_rad < kWidest) ||
      !(s.projector_view_rad > 0 && s.projector_view_rad < kWidest))
    return Error{"fields of view are above 0 and below 170 degrees"};
  if (!(s.baseline_m > 0) || !(s.distance_m > 0) || !(s.frame_rate > 0))
    return Error{"baseline, distance and frame rate are above 0"};
  Rig rig;
  rig.scan = s.scan;
  rig.frame_rate = s.frame_rate;
  const auto pinhole = [](int width, int height, double view_rad) {
    const double f = width / 2.0 / std::tan(view_rad / 2);
    return PinholeModel{width, height, {f, 0, (width - 1) / 2.0, 0, f, (height - 1) / 2.0, 0, 0, 1}, {}};
  };
  rig.camera = pinhole(s.camera_width, s.camera_height, s.camera_view_rad);
  rig.projector = pinhole(s.projector_width, s.projector_height, s.projector_view_rad);
  const double angle = std::atan2(s.baseline_m, s.distance_m), co = std::cos(angle), si = std::sin(angle);
  rig.projector_from_camera_rotation = {co, 0, si, 0, 1, 0, -si, 0, co};
  rig.projector_from_camera_translation = {-co * s.baseline_m, 0, si * s.baseline_m};
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return rig;
}

Result<Plan> make_plan(const Rig& rig, const Pattern& pattern, const PlanConditions& c) {
  if (!(c.near_m > 0) || !(c.near_m <= c.distance_m) || !(c.distance_m <= c.far_m))
    return Error{"depths must be above 0 and in order: near " + number(c.near_m, 3) + " m, distance " +
                 number(c.distance_m, 3) + " m, far " + number(c.far_m, 3) + " m"};
  if (!(c.level > 0) || !(c.noise > 0)) return Error{"level and noise must be above 0"};
  Plan plan;
  const std::array depths{c.near_m, c.distance_m, c.far_m};
  for (std::size_t i = 0; i < 3; ++i) {
    plan.at[i] = at_depth(rig, pattern, c, depths[i]);
    if (plan.at[i].stripe_px <= 0)
      return Error{"at " + number(depths[i], 3) +
                   " m camera and projector have no view in common: change the baseline, the distance or the "
                   "lenses"};
  }
  plan.unique = codes_are_unique(pattern);
  plan.one_boundary = span_of_one_slide(rig, pattern, c.distance_m, 1);
  plan.three_boundaries = span_of_one_slide(rig, pattern, c.distance_m, 3);
  plan.recommended_stripes = recommend(rig, plan, pattern);
  plan.warnings = warnings_of(rig, pattern, c, plan);
  return plan;
}

}  // namespace relievo
