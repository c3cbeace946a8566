// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_estimator.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr float kUsualSigma_px = 0.1F;  // where the decoder says nothing
constexpr float kLeastSigma_px = 0.005F;
constexpr float kGate = 3;  // standard deviations: beyond, it is another surface
constexpr float kLongestMemory =
    8;                            // frames: an estimate's variance is at least this share of a measurement's
constexpr float kForgetting = 2;  // of variance, a frame without a measurement
constexpr float kLargestVariance_px = 1;  // beyond, nothing is known
constexpr int kLinesAround = 2;           // on both sides, and one boundary
constexpr float kLeastAround = 4;         // places, to tell motion from noise
constexpr int kFarthestLine = 3;          // of neighbours along a boundary
constexpr float kToleranceShare = 0.5F;   // of the estimate's sigma

std::size_t lines_of(const StripeGrid& grid) {
  return static_cast<std::size_t>(grid.lines);
}

}  // namespace

void GridEstimator::start(const StripeGrid& grid) {
  const std::size_t size = grid.columns.size();
  if (known_.size() != size) {
    known_.assign(size, 0);
    known_variance_.assign(size, 0);
  }
  for (Plane* plane : {&column_, &variance_, &weighted_, &weight_}) plane->assign(size, 0);
  for (Plane* plane : {&count_, &sum_, &squares_, &scratch_}) plane->resize(size);
}

void GridEstimator::measure(const Surface& measured, const StripeGrid& grid) {
  for (const GridPoint& p : measured.grid) {
    const std::size_t at = grid.at(p.line, p.boundary);
    if (grid.columns[at] == StripeGrid::kAbsent) continue;  // left out: too far away
    const float sigma = p.sigma_px > 0 ? std::clamp(p.sigma_px, kLeastSigma_px, 1.F) : kUsualSigma_px;
    column_[at] = p.column_px;
    variance_[at] = sigma * sigma;
  }
}

/// Each number becomes the sum over five lines and three boundaries around it.
void GridEstimator::sum_around(const StripeGrid& grid, Plane& plane) {
  const auto stride = static_cast<std::size_t>(grid.stride());
  const auto picture_lines = static_cast<std::size_t>(grid.picture_lines());
  const std::size_t size = plane.size();
  scratch_[0] = scratch_[size - 1] = 0;
  for (std::size_t i = 1; i + 1 < size; ++i) scratch_[i] = plane[i - 1] + plane[i] + plane[i + 1];
  for (std::size_t line = 0; line < lines_of(grid); ++line) {
    const std::size_t top = line < picture_lines ? 0 : picture_lines;  // of these lines of the picture
    const std::size_t first = std::max(line, top + kLinesAround) - kLinesAround;
    const std::size_t last = std::min(line + kLinesAround + 1, top + picture_lines);
    float* to = plane.data() + line * stride;
    std::fill_n(to, stride, 0.F);
    for (std::size_t l = first; l < last; ++l)
      for (std::size_t b = 0; b < stride; ++b) to[b] += scratch_[l * stride + b];
  }
}

/// The measurement and the estimate of the frame before.
void GridEstimator::fuse_times(const StripeGrid& grid) {
  const std::size_t size = column_.size();
  for (std::size_t i = 0; i < size; ++i) {
    const bool both = variance_[i] > 0 && known_variance_[i] > 0;
    const float e = both ? column_[i] - known_[i] : 0;
    count_[i] = both ? 1 : 0;
    sum_[i] = e;
    squares_[i] = e * e;
  }
  for (Plane* plane : {&count_, &sum_, &squares_}) sum_around(grid, *plane);
  for (std::size_t i = 0; i < size; ++i) {
    if (!(variance_[i] > 0)) {
      known_variance_[i] *= kForgetting;
      if (known_variance_[i] > kLargestVariance_px) known_variance_[i] = 0;
      continue;
    }
    const float measured = variance_[i];
    if (known_variance_[i] > 0) {
      const float noise = measured + known_variance_[i];
      const float e = column_[i] - known_[i];
      // How the places around have moved together, less what is noise; and how much each by itself.
      float motion = 0;
      float apart = std::max(0.F, e * e - noise);
      float unsure = 0;
      if (const float n = count_[i]; n >= kLeastAround) {
        const float mean = sum_[i] / n;
        motion = mean * std::max(0.F, 1 - 2 * noise / n / (mean * mean + 1e-12F));
        unsure = motion != 0 ? noise / n : 0;
        apart = std::max(0.F, (squares_[i] - n * mean * mean) / (n - 1) - noise);
      }
      const float left = e - motion;
      if (left * left < kGate * kGate * (noise + apart)) {
        const float prior = known_variance_[i] + apart + unsure;
        const float gain = prior / (prior + measured);
        column_[i] = known_[i] + motion + gain * left;
        variance_[i] = std::max(gain * measured, measured / kLongestMemory);
      }
    }
    known_[i] = column_[i];
    known_variance_[i] = variance_[i];
  }
}

/// Whether triangles lead from a place to that neighbour.
bool GridEstimator::linked(const StripeGrid& grid, std::size_t at, int lines_apart,
                           int boundaries_apart) const {
  const auto stride = static_cast<std::size_t>(grid.stride());
  for (int l = 0; l < lines_apart; ++l, at += stride)
    if ((grid.cells[at] | grid.cells[at - 1]) == 0) return false;
  for (int b = 0; b < boundaries_apart; ++b, ++at)
    if ((grid.cells[at] | grid.cells[at - stride]) == 0) return false;
  return true;
}

/// The middle of the neighbours so far away on both sides.
void GridEstimator::add_neighbours(const StripeGrid& grid, int lines_apart, int boundaries_apart) {
  const auto stride = static_cast<std::size_t>(grid.stride());
  const auto away =
      static_cast<std::size_t>(lines_apart) * stride + static_cast<std::size_t>(boundaries_apart);
  const std::size_t begin = std::max(away, stride), end = column_.size() - std::min(away, column_.size());
  std::ranges::fill(count_, 0.F);
  std::ranges::fill(squares_, 0.F);
  const auto difference = [&](std::size_t i) {
    return 0.5F * (column_[i - away] + column_[i + away]) - column_[i];
  };
  const auto middle_variance = [&](std::size_t i) {
    return 0.25F * (variance_[i - away] + variance_[i + away]);
  };
  for (std::size_t i = begin; i < end; ++i) {
    if (!(variance_[i] > 0 && variance_[i - away] > 0 && variance_[i + away] > 0) ||
        !linked(grid, i - away, lines_apart, boundaries_apart) ||
        !linked(grid, i, lines_apart, boundaries_apart))
      continue;
    const float d = difference(i);
    count_[i] = 1;
    squares_[i] = d * d - variance_[i] - middle_variance(i);  // what the variances do not explain
  }
  sum_.assign(count_.begin(), count_.end());
  sum_around(grid, count_);
  sum_around(grid, squares_);
  for (std::size_t i = begin; i < end; ++i) {
    if (sum_[i] == 0 || count_[i] < kLeastAround) continue;
    const float bend = std::max(0.F, squares_[i] / count_[i]);
    const float d = difference(i);
    const float variance = middle_variance(i) + bend;
    if (d * d > kGate * kGate * (variance_[i] + variance)) continue;
    weighted_[i] += d / variance;
    weight_[i] += 1 / variance;
  }
}

void GridEstimator::estimate(const Surface& measured, StripeGrid& grid,
                             std::vector<std::uint8_t>& tolerance) {
  start(grid);
  measure(measured, grid);
  fuse_times(grid);
  for (int l = 1; l <= kFarthestLine; ++l) add_neighbours(grid, l, 0);
  add_neighbours(grid, 0, 1);
  tolerance.assign(grid.columns.size(), 0);
  const auto steps = static_cast<float>(1 << grid.step_bits);
  for (std::size_t i = 0; i < column_.size(); ++i) {
    if (!(variance_[i] > 0)) continue;
    const float weight = 1 / variance_[i] + weight_[i];
    const float column = column_[i] + weighted_[i] / weight;
    const float sigma = std::sqrt(1 / weight);
    grid.columns[i] = static_cast<std::int32_t>(std::floor(column * steps + 0.5F));
    tolerance[i] = static_cast<std::uint8_t>(std::min(kToleranceShare * sigma * steps, 255.F));
    const float step_px = static_cast<float>(2 * tolerance[i] + 1) / steps;
    if (!grid.sigmas.empty() && grid.sigmas[i] != 0)
      grid.sigmas[i] = sigma_px_code(sigma_of_rounded_px(sigma, step_px));
  }
}

}  // namespace relievo
