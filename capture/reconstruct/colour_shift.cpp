// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/colour_shift.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/crossing.h"
#include "capture/reconstruct/luma_place.h"

namespace relievo {
namespace {

constexpr int kSearch_px = 3;  // to each side of the boundary, one of them for the edge's bend
static_assert(2 * kSearch_px + 2 == StripedRow::kOut);

/// Of a channel of a primary: -1 or 1.
float sign_of(Primary colour, std::size_t channel) {
  return (colour >> channel & 1) != 0 ? 1.F : -1.F;
}

}  // namespace

ColourShift::ColourShift(const std::array<double, 9>& colour_matrix)
    : luma_(luma_weights(colour_matrix)), differences_(blur_kernels().back().differences) {
  constexpr std::size_t kTaps = StripedRow::kTaps;
  const auto& m = colour_matrix;
  for (std::size_t q = 0; q < 3; ++q) white_[q] = static_cast<float>(m[3 * q] + m[3 * q + 1] + m[3 * q + 2]);
  for (std::size_t b = 0; b < kBlurs; ++b) {
    std::array<double, kTaps> blur{};
    const double sigma = std::max(1e-3, static_cast<double>(kBlur_px[b]));
    double sum = 0;
    for (std::size_t i = 1; i + 1 < kTaps; ++i) {
      blur[i] = std::exp(-0.5 * std::pow((static_cast<double>(i) - StripedRow::kReach) / sigma, 2));
      sum += blur[i];
    }
    for (std::size_t i = 0; i < kTaps; ++i) {
      const double before = i > 0 ? blur[i - 1] : 0;
      const double after = i + 1 < kTaps ? blur[i + 1] : 0;
      kernels_[b][i] = static_cast<float>((before + 2 * blur[i] + after) / (4 * sum));
    }
  }
}

float ColourShift::shift_px(const ShiftQuery& query, std::size_t blur) const {
  using Stripe = StripedRow::Stripe;
  const int from = static_cast<int>(query.column_px + 0.5F) - kSearch_px;  // column of the first output
  const int first = from - StripedRow::kReach;
  if (first < 0 || first + static_cast<int>(StripedRow::kColumns) > query.width) return 0;
  StripedRow row{.first_px = static_cast<float>(first),
                 .column_px = query.column_px,
                 .left_end_px = query.left_end_px,
                 .right_end_px = query.right_end_px,
                 .signs = {},
                 .luma = luma_,
                 .grey = white_,
                 .blur = &kernels_[blur]};
  std::copy_n(query.white + first, StripedRow::kColumns, row.white.begin());
  for (std::size_t q = 0; q < 3; ++q)
    row.signs[q] = {sign_of(query.colours[0], q), sign_of(query.colours[1], q),
                    sign_of(query.beyond_colours[0], q), sign_of(query.beyond_colours[1], q)};
  std::array<StripedRow::Out, 3> differences;
  differences_(row, differences);
  float weight = 0;
  float sum = 0;
  for (std::size_t q = 0; q < 3; ++q) {
    const float rise = row.signs[q][Stripe::kRight] - row.signs[q][Stripe::kLeft];
    if (rise == 0) continue;
    StripedRow::Out& d = differences[q];
    for (float& value : d) value *= rise;
    // The crossing nearest the boundary, weighed as EdgeFinder weighs it.
    float nearest = static_cast<float>(kSearch_px);
    float slope = 0;
    for (std::size_t i = 1; i + 2 < d.size(); ++i) {
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
