// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_step.h"

#include <gtest/gtest.h>

#include <cmath>

namespace relievo {
namespace {

constexpr int kWidth = 64;
constexpr float kBoundary_px = 31.3F;
constexpr float kRoom_px = 12;
constexpr std::array<double, 9> kSameColours{1, 0, 0, 0, 1, 0, 0, 0, 1};

/// A field of one line with a boundary between two colours, as a lens shows it, under white light around.
Image8 line_with(Primary left, Primary right, float left_light, float right_light, float ambient = 0) {
  Image8 out(kWidth, 1, 3);
  for (int x = 0; x < kWidth; ++x) {
    const float share = 0.5F * (1 + std::erf((static_cast<float>(x) - kBoundary_px) / 1.8F));
    for (int c = 0; c < 3; ++c) {
      const float light = (1 - share) * left_light * static_cast<float>(left >> c & 1) +
                          share * right_light * static_cast<float>(right >> c & 1) + ambient;
      out.row(0)[3 * x + c] = static_cast<std::uint8_t>(std::lround(light));
    }
  }
  return out;
}

TEST(Balance, StaysWhereTheBoundaryIsHoweverBrightTheSidesAre) {
  const StepFinder finder(kSameColours);
  for (const auto& [left, right] : {std::array<Primary, 2>{1, 2}, {1, 3}, {6, 2}, {5, 3}}) {
    const std::vector<std::array<Primary, 2>> colours{{left, right}};
    const auto find = [&](float left_light, float right_light) {
      const Image8 field = line_with(left, right, left_light, right_light);
      return finder.balance({.field = field.view(), .colours = colours, .noise = 1}, 0, 0,
                            kBoundary_px + 0.3F, kRoom_px, kRoom_px);
    };
    const auto even = find(160, 160);
    ASSERT_TRUE(even) << +left << +right;
    EXPECT_NEAR(even->column_px, kBoundary_px, 0.1) << +left << +right;
    const auto uneven = find(200, 120);
    ASSERT_TRUE(uneven) << +left << +right;
    // The lens itself mixes the bright side into the dark one, up to a third of a pixel.
    EXPECT_NEAR(uneven->column_px, kBoundary_px, 0.4) << +left << +right;
  }
}

TEST(Balance, NothingWhereTheStripesAreOtherwise) {
  const StepFinder finder(kSameColours);
  const std::vector<std::array<Primary, 2>> colours{{2, 1}};
  const Image8 field = line_with(1, 2, 160, 160);
  EXPECT_FALSE(finder.balance({.field = field.view(), .colours = colours, .noise = 1}, 0, 0, kBoundary_px,
                              kRoom_px, kRoom_px));
  // So near to the picture's side that the light cannot be told.
  EXPECT_FALSE(
      finder.balance({.field = field.view(), .colours = colours, .noise = 1}, 0, 0, 5, kRoom_px, kRoom_px));
}

// The step there is another boundary's, whatever was looked at before.
TEST(StepFinder, LooksNoFartherThanItShould) {
  const StepFinder finder(kSameColours);
  const std::vector<std::array<Primary, 2>> colours{{1, 6}};
  const Image8 dark = line_with(1, 6, 0, 0);
  const Image8 field = line_with(1, 6, 160, 160);
  const auto find = [&](const Image8& picture, float from_px) {
    const SlideFieldView view{.field = picture.view(), .colours = colours, .noise = 1};
    return finder.find(view, 0, 0, {kBoundary_px + from_px, 0.5F, kRoom_px, kRoom_px});
  };
  EXPECT_FALSE(find(dark, 3.4F));
  EXPECT_FALSE(find(field, 3.4F));
  EXPECT_TRUE(find(field, 2));
}

// Without it taken off, no channel is dark enough to be off.
TEST(StepFinder, KnowsColoursUnderAmbientLight) {
  const StepFinder finder(kSameColours);
  const std::vector<std::array<Primary, 2>> colours{{1, 6}};
  const Image8 field = line_with(1, 6, 120, 120, 100);
  SlideFieldView view{.field = field.view(), .colours = colours, .noise = 1};
  const StepPrediction near{kBoundary_px + 0.3F, 0.5F, kRoom_px, kRoom_px};
  EXPECT_FALSE(finder.find(view, 0, 0, near));
  view.ambient = 100.F / 220;
  const auto found = finder.find(view, 0, 0, near);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->column_px, kBoundary_px, 0.1);
  // Another boundary is still another.
  const std::vector<std::array<Primary, 2>> others{{2, 5}};
  const SlideFieldView other{.field = field.view(), .colours = others, .noise = 1, .ambient = view.ambient};
  EXPECT_FALSE(finder.find(other, 0, 0, near));
  EXPECT_TRUE(finder.shows_another(other, 0, 0, kBoundary_px, kRoom_px, kRoom_px));
}

}  // namespace
}  // namespace relievo
