// SPDX-License-Identifier: Apache-2.0
// Proves: columns are smoothed by those beside them where these foretell them, and nowhere else.
#include "capture/reconstruct/smooth_across.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>

namespace relievo {
namespace {

constexpr int kLines = 20, kBoundaries = 60;
constexpr float kSigma_px = 0.02F;

/// A surface's columns, bent as a cubic.
float column(int b) {
  const float x = static_cast<float>(b) / kBoundaries;
  return 20 + 8 * static_cast<float>(b) + 5 * x * x - 9 * x * x * x;
}
template <class Off>
DecodedGrid grid(const Off& off, float sigma_px = kSigma_px) {
  DecodedGrid out;
  out.reset(kBoundaries, kLines);
  for (int line = 0; line < kLines; ++line)
    for (int b = 0; b < kBoundaries; ++b) out.put(line, b, column(b) + off(line, b), sigma_px, 1);
  return out;
}
void smooth(DecodedGrid& grid, int threads = 1) {
  WorkerPool pool(threads);
  smooth_across(pool, grid);
}

TEST(SmoothAcross, NoiseIsLessAndSaysSo) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, kSigma_px);
  DecodedGrid noisy = grid([&](int, int) { return noise(random); });
  smooth(noisy, 3);
  double squares = 0, count = 0;
  float sigma_px = 0;
  for (int line = 0; line < kLines; ++line) {
    for (int b = 2; b + 2 < kBoundaries; ++b) {
      const double off = noisy.column_px(line)[b] - column(b);
      squares += off * off;
      ++count;
    }
    sigma_px = noisy.sigma_px(line)[kBoundaries / 2];
  }
  EXPECT_LT(sigma_px, 0.72F * kSigma_px);
  EXPECT_NEAR(std::sqrt(squares / count), sigma_px, 0.05 * kSigma_px);
}

TEST(SmoothAcross, WhatIsSmoothStays) {
  DecodedGrid smooth_grid = grid([](int, int) { return 0.F; });
  smooth(smooth_grid);
  for (int b = 0; b < kBoundaries; ++b) EXPECT_NEAR(smooth_grid.column_px(5)[b], column(b), 1e-4F) << b;
}

TEST(SmoothAcross, WhereTheSurfaceItselfBendsItStays) {
  // A step that is much in pixels, and one that is little in pixels but much in standard deviations.
  for (const auto& [step_px, sigma_px] : {std::pair{0.3F, 0.05F}, std::pair{0.09F, 0.004F}}) {
    const auto step = [step = step_px](int, int b) { return b < 30 ? 0.F : step; };
    DecodedGrid stepped = grid(step, sigma_px);
    smooth(stepped);
    for (int b = 0; b < kBoundaries; ++b) {
      const bool beside = b == 29 || b == 30;  // those two further on see an eighth of it
      EXPECT_NEAR(stepped.column_px(5)[b], column(b) + step(5, b), beside ? 2e-4F : 2 * sigma_px) << b;
    }
  }
}

TEST(SmoothAcross, WithoutAllFourBesideItOrItsOwnDeviationItStays) {
  const auto zigzag = [](int, int b) { return b % 2 == 0 ? 0.01F : -0.01F; };
  DecodedGrid holed = grid(zigzag);
  holed.column_px(3)[10] = kNoColumn;
  smooth(holed);
  EXPECT_TRUE(std::isnan(holed.column_px(3)[10]));
  for (const int b : {0, 1, 8, 9, 11, 12, kBoundaries - 2, kBoundaries - 1})
    EXPECT_EQ(holed.column_px(3)[b], column(b) + zigzag(3, b)) << b;
  EXPECT_NE(holed.column_px(3)[20], column(20) + zigzag(3, 20));
  DecodedGrid unknown = grid(zigzag, 0);
  smooth(unknown);
  for (int b = 0; b < kBoundaries; ++b) EXPECT_EQ(unknown.column_px(3)[b], column(b) + zigzag(3, b));
}

}  // namespace
}  // namespace relievo
