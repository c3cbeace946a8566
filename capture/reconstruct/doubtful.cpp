// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/doubtful.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/place_rules.h"

namespace relievo {

using place_rules::squared;

namespace {

// Measured on simulated scenes: log-odds of a large error are linear in the logarithms of the three, with
// about these ratios.
constexpr float kSure_px = 0.06F;  // what is surer stays
constexpr float kMost_px = 0.53F;  // standard deviation, beside stripes of kStripe_px, so far out of line:
constexpr float kMostMoving_px = 0.45F;  // and where so many boundaries around were elsewhere
constexpr int kMoves = 4;
constexpr float kOutOfLine_px = 0.1F;  // it counts by its root,
constexpr float kStripe_px = 8;        // and this by its square,
constexpr float kStripes = 1.3F;       // or so many of the frame's usual stripe, where that is less
constexpr float kLeastOutOfLine_px = 0.03F;
constexpr float kMostOutOfLine_px = 3;
constexpr float kUnknownOutOfLine_px = 0.5F;  // too few lines above and below
constexpr float kNarrowest_px = 2;
constexpr float kWidest_px = 20;
constexpr float kUnknownStripe_px = 7;  // no boundary beside it
constexpr int kLinesApart = 8;          // that tell the usual stripe

/// How far `column_px` is from where three lines' columns, the nearest first, go on to; NaN where they do
/// not.
float out_of_line_px(float column_px, const std::array<float, 3>& x) {
  return std::fabs(3 * (x[0] - x[1]) + x[2] - column_px);
}

/// `v` within limits; `unknown` for NaN.
float within(float v, float least, float most, float unknown) {
  return v == v ? std::clamp(v, least, most) : unknown;
}

/// Which stripe is none too narrow. Where all are narrow that tells of no surface that turns away.
float wide_stripe_px(const DecodedGrid& grid) {
  float sum_px = 0;
  int count = 0;
  for (int line = 0; line < grid.lines(); line += kLinesApart) {
    const float* column_px = grid.column_px(line);
    for (int b = 1; b < grid.boundaries(); ++b) {
      const float stripe_px = column_px[b] - column_px[b - 1];
      if (!(stripe_px > 0 && stripe_px < kWidest_px)) continue;
      sum_px += stripe_px;
      ++count;
    }
  }
  return count > 0 ? std::min(kStripe_px, kStripes * sum_px / static_cast<float>(count)) : kStripe_px;
}

/// Of the place at `column`; `line` cells further on is the one on the next line.
bool doubtful(const float* column, std::ptrdiff_t line, float sigma_px, float most_px, float wide_px) {
  // Not in order beside what is in front.
  const float stripe_px =
      within(std::fmin(std::fabs(column[1] - column[0]), std::fabs(column[0] - column[-1])), kNarrowest_px,
             kWidest_px, kUnknownStripe_px);
  const float above = out_of_line_px(*column, {column[-line], column[-2 * line], column[-3 * line]});
  const float below = out_of_line_px(*column, {column[line], column[2 * line], column[3 * line]});
  const float off_px =
      within(std::fmin(above, below), kLeastOutOfLine_px, kMostOutOfLine_px, kUnknownOutOfLine_px);
  return squared(sigma_px / most_px) * (off_px / kOutOfLine_px) * squared(squared(wide_px / stripe_px)) > 1;
}

}  // namespace

std::size_t give_up_doubtful(const MovingPlaces& moving, int width, WorkerPool& pool, DecodedGrid& grid) {
  constexpr float kGivenUp = std::numeric_limits<float>::infinity();  // a standard deviation
  const std::ptrdiff_t next_line = grid.column_px(1) - grid.column_px(0);
  const float wide_px = wide_stripe_px(grid);
  const auto last_px = static_cast<float>(width - 1);
  std::atomic<std::size_t> given_up{0};
  // All are judged before any is taken away.
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      const DecodedRow row = grid.decoded(line);
      for (int b = 0; b < grid.boundaries(); ++b) {
        const float column_px = row.column_px[b];
        const float sigma_px = row.sigma_px[b];
        if (column_px < 0 || column_px > last_px) row.sigma_px[b] = kGivenUp;
        if (column_px != column_px || sigma_px < kSure_px) continue;
        const float most_px = moving.around(line, column_px) >= kMoves ? kMostMoving_px : kMost_px;
        if (doubtful(row.column_px + b, next_line, sigma_px, most_px, wide_px)) row.sigma_px[b] = kGivenUp;
      }
    }
  });
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    std::size_t own = 0;
    for (int line = begin; line < end; ++line) {
      const DecodedRow row = grid.decoded(line);
      for (int b = 0; b < grid.boundaries(); ++b) {
        if (row.column_px[b] != row.column_px[b] || row.sigma_px[b] != kGivenUp) continue;
        row.column_px[b] = kNoColumn;
        ++own;
      }
    }
    given_up += own;
  });
  return given_up;
}

}  // namespace relievo
