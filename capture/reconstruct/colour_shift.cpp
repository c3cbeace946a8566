// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/colour_shift.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/crossing.h"
#include "capture/reconstruct/luma_place.h"

namespace relievo {
namespace {

constexpr float kRamp_px = 3.2F;  // from one stripe's colour to the next one's, of lens, pixel and projector
constexpr int kSearch_px = 3;     // to each side of the boundary, one of them for the edge's bend

/// 0..1: how much of the stripe right of an end there is at a column. Smooth, so that no shift comes from
/// where the columns' samples happen to lie.
float behind(float off_px) {
  const float share = std::clamp(0.5F + off_px * (1 / kRamp_px), 0.F, 1.F);
  return share * share * (3 - 2 * share);
}

/// Of a channel of a primary: -1 or 1.
float sign_of(Primary colour, std::size_t channel) {
  return (colour >> channel & 1) != 0 ? 1.F : -1.F;
}

}  // namespace

ColourShift::ColourShift(const std::array<double, 9>& colour_matrix) : luma_(luma_weights(colour_matrix)) {
  const auto& m = colour_matrix;
  for (std::size_t q = 0; q < 3; ++q) white_[q] = static_cast<float>(m[3 * q] + m[3 * q + 1] + m[3 * q + 2]);
  for (std::size_t b = 0; b < kBlurs; ++b) {
    std::array<double, kTaps> blur{};
    const double sigma = std::max(1e-3, static_cast<double>(kBlur_px[b]));
    double sum = 0;
    for (int i = 1; i + 1 < kTaps; ++i) {
      blur[static_cast<std::size_t>(i)] = std::exp(-0.5 * std::pow((i - kReach) / sigma, 2));
      sum += blur[static_cast<std::size_t>(i)];
    }
    for (std::size_t i = 0; i < kTaps; ++i) {
      const double before = i > 0 ? blur[i - 1] : 0;
      const double after = i + 1 < kTaps ? blur[i + 1] : 0;
      kernels_[b][i] = static_cast<float>((before + 2 * blur[i] + after) / (4 * sum));
    }
  }
}

float ColourShift::shift_px(const ShiftQuery& query, std::size_t blur) const {
  constexpr int kOut = 2 * kSearch_px + 2;
  constexpr int kIn = kOut + 2 * kReach;
  using Out = std::array<float, kOut>;
  using In = std::array<float, kIn>;
  const int from = static_cast<int>(query.column_px + 0.5F) - kSearch_px;  // column of the first output
  const int first = from - kReach;
  if (first < 0 || first + kIn > query.width) return 0;
  In right, beyond_left, beyond_right;
  for (int i = 0; i < kIn; ++i) {
    const auto column = static_cast<float>(first + i);
    const auto at = static_cast<std::size_t>(i);
    right[at] = behind(column - query.column_px);
    beyond_left[at] = 1 - behind(column - query.left_end_px);
    beyond_right[at] = behind(column - query.right_end_px);
  }
  std::array<In, 3> light;  // of each channel: the surface's brightness, of the stripes' signs
  In luma{};
  for (std::size_t q = 0; q < 3; ++q) {
    const float l = sign_of(query.colours[0], q);
    const float r = sign_of(query.colours[1], q);
    const float ll = sign_of(query.beyond_colours[0], q);
    const float rr = sign_of(query.beyond_colours[1], q);
    for (std::size_t i = 0; i < kIn; ++i) {
      const float sign = l + (r - l) * right[i] + (ll - l) * beyond_left[i] + (rr - r) * beyond_right[i];
      light[q][i] = query.white[first + static_cast<int>(i)] * sign;
      luma[i] += luma_[q] * light[q][i];
    }
  }
  const auto blurred = [](const In& in, const std::array<float, kTaps>& kernel) {
    Out out{};
    for (std::size_t k = 0; k < kTaps; ++k)
      for (std::size_t i = 0; i < kOut; ++i) out[i] += kernel[k] * in[i + k];
    return out;
  };
  const Out sharp_luma = blurred(luma, kernels_[0]);
  const Out blurred_luma = blurred(luma, kernels_[blur]);
  float weight = 0;
  float sum = 0;
  for (std::size_t q = 0; q < 3; ++q) {
    const float rise = sign_of(query.colours[1], q) - sign_of(query.colours[0], q);
    if (rise == 0) continue;
    Out d = blurred(light[q], kernels_[blur]);
    for (std::size_t i = 0; i < kOut; ++i)
      d[i] = rise * (d[i] + white_[q] * (sharp_luma[i] - blurred_luma[i]));
    // The crossing nearest the boundary, weighed as EdgeFinder weighs it.
    float nearest = static_cast<float>(kSearch_px);
    float slope = 0;
    for (std::size_t i = 1; i + 2 < kOut; ++i) {
      if (d[i] > 0 || d[i + 1] <= 0) continue;
      const float off =
          static_cast<float>(from + static_cast<int>(i)) + crossing_behind(&d[i], 0) - query.column_px;
      if (std::fabs(off) >= std::fabs(nearest)) continue;
      nearest = off;
      slope = d[i + 1] - d[i];
    }
    weight += slope * slope;
    sum += slope * slope * nearest;
  }
  return weight > 0 ? sum / weight : 0;
}

}  // namespace relievo
