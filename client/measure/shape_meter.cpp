// SPDX-License-Identifier: Apache-2.0
#include "client/measure/shape_meter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "base/lens.h"
#include "codec/surface_check.h"

namespace relievo {
namespace {

constexpr std::size_t kLeastPoints = 50;
constexpr double kOffDeviations = 5;
constexpr double kMadToSigma = 1.4826;
constexpr double kSpanShare = 0.997;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

Spread spread(const std::vector<double>& values) {
  if (values.empty()) return {};
  const double n = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return {median(values), values.size() > 1 ? std::sqrt(squares / (n - 1)) : 0};
}

}  // namespace

PictureRegion middle_region(const PinholeModel& camera) {
  const int width = std::max(1, camera.width * 2 / 5), height = std::max(1, camera.height * 2 / 5);
  return {(camera.width - width) / 2, (camera.height - height) / 2, width, height};
}

ShapeMeter::ShapeMeter(const PinholeModel& camera, const PictureRegion& region, ShapeKind kind)
    : camera_(camera), region_(region), kind_(kind), depths_(camera) {
  for (int row = region.row; row < region.row + region.height; ++row) {
    for (int column = region.column; column < region.column + region.width; ++column)
      rays_.push_back(undistort(camera, column, row).value_or(std::array{kNone, kNone}));
  }
  pixels_.resize(rays_.size());
}

Status ShapeMeter::add(const Frame3D& frame) {
  if (Status sound = check_surface(frame.surface); !sound) return sound;
  collect(frame.surface);
  const auto shape = points_.size() < kLeastPoints ? std::nullopt : fit_shape(kind_, points_);
  if (!shape) {
    ++without_shape_;
    return {};
  }
  measure_heights(*shape);
  measure_place(*shape);
  measure_pixels(frame.surface, *shape);
  return {};
}

void ShapeMeter::collect(const Surface& surface) {
  points_.clear();
  sigmas_m_.clear();
  for (std::size_t i = 0; i < surface.positions.size(); ++i) {
    const Vec3f& p = surface.positions[i];
    const double z = static_cast<double>(p[2]);
    if (!(z > 0) || (!surface.interpolated.empty() && surface.interpolated[i] != 0)) continue;
    const auto [column, row] = distort(camera_, static_cast<double>(p[0]) / z, static_cast<double>(p[1]) / z);
    // A pixel's middle is a whole number.
    if (!(column >= region_.column - 0.5 && column < region_.column + region_.width - 0.5) ||
        !(row >= region_.row - 0.5 && row < region_.row + region_.height - 0.5))
      continue;
    points_.push_back(p);
    sigmas_m_.push_back(surface.sigmas_m.empty() ? 0 : surface.sigmas_m[i]);
  }
}

void ShapeMeter::measure_heights(const Shape& shape) {
  heights_m_.clear();
  for (const Vec3f& p : points_) heights_m_.push_back(shape.height_m(p));
  std::vector<double> sizes = heights_m_;
  for (double& size : sizes) size = std::fabs(size);
  const double limit_m = kOffDeviations * kMadToSigma * median(std::move(sizes));
  double squares = 0, expected_squares = 0;
  std::size_t on = 0;
  bool known = true;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (std::fabs(heights_m_[i]) > limit_m) continue;
    ++on;
    squares += heights_m_[i] * heights_m_[i];
    if (sigmas_m_[i] <= 0) known = false;
    // An error of depth moves the point along its ray.
    const auto n = shape.normal_at(points_[i]);
    double across = 0;
    for (std::size_t k = 0; k < 3; ++k)
      across += n[k] * static_cast<double>(points_[i][k]) / static_cast<double>(points_[i][2]);
    const double moved_m = across * static_cast<double>(sigmas_m_[i]);
    expected_squares += moved_m * moved_m;
  }
  const double count = static_cast<double>(points_.size());
  series_.points.push_back(count);
  series_.off.push_back(1 - static_cast<double>(on) / count);
  series_.rms_m.push_back(std::sqrt(squares / static_cast<double>(on)));
  if (known) series_.expected_m.push_back(std::sqrt(expected_squares / static_cast<double>(on)));

  std::ranges::sort(heights_m_);
  const auto cut = static_cast<std::size_t>(std::floor((1 - kSpanShare) / 2 * count));
  series_.span_m.push_back(heights_m_[heights_m_.size() - 1 - cut] - heights_m_[cut]);
}

void ShapeMeter::measure_place(const Shape& shape) {
  if (kind_ == ShapeKind::kSphere) {
    series_.size_m.push_back(shape.size_m);
    for (std::size_t k = 0; k < 3; ++k) series_.centre_m[k].push_back(shape.at[k]);
    return;
  }
  const auto ray = undistort(camera_, region_.column + (region_.width - 1) / 2.0,
                             region_.row + (region_.height - 1) / 2.0);
  const double across = ray ? shape.at[0] * (*ray)[0] + shape.at[1] * (*ray)[1] + shape.at[2] : kNone;
  series_.size_m.push_back(-shape.size_m / across);
  series_.tilt_deg.push_back(std::acos(std::clamp(-shape.at[2], -1.0, 1.0)) * 180 / std::numbers::pi);
}

void ShapeMeter::measure_pixels(const Surface& surface, const Shape& shape) {
  depths_.clear();
  depths_.draw(surface);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const auto row = static_cast<std::size_t>(region_.row) + i / static_cast<std::size_t>(region_.width);
    const auto column =
        static_cast<std::size_t>(region_.column) + i % static_cast<std::size_t>(region_.width);
    const double z = depths_.at(row * static_cast<std::size_t>(camera_.width) + column);
    if (!std::isfinite(z)) continue;
    ++filled_;
    const auto& [x, y] = rays_[i];
    const double height_m =
        shape.height_m({static_cast<float>(x * z), static_cast<float>(y * z), static_cast<float>(z)});
    if (!std::isfinite(height_m)) continue;
    Pixel& pixel = pixels_[i];
    const double n = static_cast<double>(++pixel.frames);
    pixel.height_m += (height_m - pixel.height_m) / n;
    const double before = z - pixel.depth_m;
    pixel.depth_m += before / n;
    pixel.depth_squares += before * (z - pixel.depth_m);
  }
}

ShapeReport ShapeMeter::report() const {
  ShapeReport out;
  out.frames = series_.points.size();
  out.without_shape = without_shape_;
  out.points = spread(series_.points);
  out.off = spread(series_.off);
  out.rms_m = spread(series_.rms_m);
  out.span_m = spread(series_.span_m);
  if (!series_.expected_m.empty()) out.expected_m = spread(series_.expected_m);
  out.size_m = spread(series_.size_m);
  out.tilt_deg = spread(series_.tilt_deg);
  for (std::size_t k = 0; k < 3; ++k) out.centre_m[k] = spread(series_.centre_m[k]);
  if (out.frames == 0) return out;

  out.filled = static_cast<double>(filled_) / static_cast<double>(out.frames * pixels_.size());
  // What is off the shape is not of its form. Pixels that most frames show count.
  std::vector<double> heights_m, deviations_m;
  for (const Pixel& pixel : pixels_) {
    if (pixel.frames * 2 < out.frames || pixel.frames == 0) continue;
    heights_m.push_back(std::fabs(pixel.height_m));
    if (pixel.frames > 1)
      deviations_m.push_back(std::sqrt(pixel.depth_squares / static_cast<double>(pixel.frames - 1)));
  }
  const double limit_m = kOffDeviations * kMadToSigma * median(heights_m);
  std::erase_if(heights_m, [&](double height_m) { return height_m > limit_m; });
  double squares = 0;
  for (const double height_m : heights_m) squares += height_m * height_m;
  if (!heights_m.empty()) out.form_m = std::sqrt(squares / static_cast<double>(heights_m.size()));
  if (!deviations_m.empty()) out.noise_m = median(std::move(deviations_m));
  return out;
}

Image8 ShapeMeter::picture(double full_m) const {
  Image8 out(region_.width, region_.height, 3);
  for (int row = 0; row < region_.height; ++row) {
    for (int column = 0; column < region_.width; ++column) {
      const Pixel& pixel = pixels_[static_cast<std::size_t>(row) * static_cast<std::size_t>(region_.width) +
                                   static_cast<std::size_t>(column)];
      std::uint8_t* const rgb = out.row(row) + 3 * static_cast<std::ptrdiff_t>(column);
      if (pixel.frames == 0) {
        rgb[0] = rgb[1] = rgb[2] = 128;
        continue;
      }
      const double share = std::clamp(pixel.height_m / full_m, -1.0, 1.0);
      const auto pale = static_cast<std::uint8_t>(std::lround(255 * (1 - std::fabs(share))));
      rgb[0] = share < 0 ? pale : 255;
      rgb[1] = pale;
      rgb[2] = share > 0 ? pale : 255;
    }
  }
  return out;
}

}  // namespace relievo
