// SPDX-License-Identifier: Apache-2.0
// Proves: a frame's own places tell how far colour and luma are off beyond noise, and which of the two it is,
// whatever the surface does that both lie on.
#include "capture/reconstruct/place_scatter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "tests/unit/capture/decoded_frame.h"

namespace relievo {
namespace {

constexpr int kLines = 60, kBoundaries = 60;
constexpr float kColourNoise_px = 0.02F, kLumaNoise_px = 0.05F;

struct Off {
  float surface_px = 0, colour_px = 0, luma_px = 0;  // standard deviations
  float contrast = 0;
  bool still = true;
};

ColourAndLumaErrors measured(const Off& off, bool of_moving = false) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal(0, 1);
  DecodedFrame frame =
      decoded_frame(kLines, kBoundaries, {.sigma_px = kColourNoise_px, .contrast = off.contrast},
                    [](int, int b) { return 20 + 8 * static_cast<float>(b); });
  std::vector<LumaSeen> seen;
  for (std::size_t e = 0; e < frame.edges.edges.size(); ++e) {
    Edge& edge = frame.edges.edges[e];
    frame.result.still[e] = off.still;
    const float surface = edge.column_px + off.surface_px * normal(random);
    edge.column_px = surface + std::hypot(off.colour_px, kColourNoise_px) * normal(random);
    seen.push_back(
        {surface + std::hypot(off.luma_px, kLumaNoise_px) * normal(random), kLumaNoise_px, 0, true, true});
  }
  PlaceScatter scatter;
  WorkerPool pool(2);
  scatter.begin(1);
  for (int line = 0; line < kLines; ++line) scatter.line(frame.edges, frame.result, seen, line, 0);
  scatter.settle_plain(pool);
  for (std::size_t e = 0; e < seen.size(); ++e) scatter.apart(frame.edges.edges[e], seen[e], off.still, 0);
  const PlaceScatter::Errors errors = scatter.errors(pool);
  return of_moving ? errors.moving : errors.still;
}

TEST(PlaceScatter, WhereNothingIsOffThereIsNoiseAlone) {
  const ColourAndLumaErrors errors = measured({});
  EXPECT_LT(errors.colour.px, 0.015F);
  EXPECT_LT(errors.luma.px, 0.015F);
  EXPECT_EQ(errors.luma.by_contrast_px, 0);
}

TEST(PlaceScatter, WhatIsOffSaysSo) {
  const ColourAndLumaErrors luma = measured({.luma_px = 0.2F});
  EXPECT_NEAR(luma.luma.px, 0.2F, 0.02F);
  EXPECT_LT(luma.colour.px, 0.06F);
  const ColourAndLumaErrors colour = measured({.colour_px = 0.2F});
  EXPECT_NEAR(colour.colour.px, 0.2F, 0.02F);
  EXPECT_LT(colour.luma.px, 0.06F);
}

TEST(PlaceScatter, ASurfaceThatIsNoCubicIsNeithersError) {
  const ColourAndLumaErrors errors = measured({.surface_px = 0.5F});
  EXPECT_LT(errors.colour.px, 0.03F);
  EXPECT_LT(errors.luma.px, 0.03F);
}

TEST(PlaceScatter, OfContrastItSaysHowMuchIsWhose) {
  const ColourAndLumaErrors luma = measured({.luma_px = 0.3F, .contrast = 0.5F});
  EXPECT_NEAR(luma.luma.by_contrast_px, 0.6F, 0.08F);
  const ColourAndLumaErrors colour = measured({.colour_px = 0.3F, .contrast = 0.5F});
  EXPECT_LT(colour.luma.by_contrast_px, 0.2F);
  EXPECT_GT(colour.colour.by_contrast_px, 0.6F);
  EXPECT_GT(colour.colour.by_contrast_px, 2 * luma.colour.by_contrast_px);
}

TEST(PlaceScatter, WhatMovesIsColours) {
  const ColourAndLumaErrors errors = measured({.luma_px = 0.3F, .contrast = 0.5F, .still = false}, true);
  EXPECT_EQ(errors.luma.by_contrast_px, 0);
  EXPECT_GT(errors.colour.by_contrast_px, 0.6F);
  // Where nearly all holds still, what moves is as that.
  const ColourAndLumaErrors few = measured({.luma_px = 0.3F, .contrast = 0.5F}, true);
  EXPECT_NEAR(few.luma.by_contrast_px, 0.6F, 0.08F);
}

}  // namespace
}  // namespace relievo
