// SPDX-License-Identifier: Apache-2.0
// Colour calibration on captures of a known crosstalk, and each reason to refuse captures.
#include "capture/calibrate/colour.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace relievo {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 120, kHeight = 90;
constexpr std::array<double, 9> kSeen = {0.80, 0.14, 0.03, 0.10, 0.72,
                                         0.12, 0.02, 0.16, 0.76};  // captured = kSeen * projected

/// A white card on a dark ground.
ColourCapture capture(Primary colour, double exposure = 200, double ambient = 2, double noise = 1) {
  ColourCapture out{primary_name(colour) + ".png", colour, Image8(kWidth, kHeight, 3)};
  std::mt19937 random(colour + 1);
  std::normal_distribution<double> normal(0, noise);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool card = x >= 30 && x < 95 && y >= 20 && y < 70;
      for (std::size_t c = 0; c < 3; ++c) {
        double light = ambient;
        for (std::size_t p = 0; p < 3; ++p) light += exposure * kSeen[3 * c + p] * (colour >> p & 1);
        out.picture.row(y)[3 * x + static_cast<int>(c)] = static_cast<std::uint8_t>(
            std::clamp((card ? 1.0 : 0.2) * light + normal(random) + 0.5, 0.0, 255.0));
      }
    }
  }
  return out;
}

std::vector<ColourCapture> all(double exposure = 200, double ambient = 2, double noise = 1) {
  std::vector<ColourCapture> out;
  for (Primary colour = 0; colour < 8; ++colour) out.push_back(capture(colour, exposure, ambient, noise));
  return out;
}

std::string refusal(const std::vector<ColourCapture>& captures, const ColourOptions& options = {}) {
  const auto result = calibrate_colour(captures, options);
  return result.ok() ? "accepted" : result.error().message;
}

TEST(ColourCalibration, RecoversAKnownCrosstalk) {
  const auto result = calibrate_colour(all(), {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  // M * kSeen is the identity, but for exposure (255 / 200) and the ambient light that a linear M cannot take
  // out.
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < 3; ++k)
        product += result->camera.matrix[3 * i + k] * kSeen[3 * k + j] * 200 / 255;
      EXPECT_NEAR(product, i == j ? 1 : 0, 0.012) << i << j;
    }
  }
  EXPECT_LT(result->residual, 2.5);
  EXPECT_NEAR(result->noise, 1, 0.1);
  EXPECT_NEAR(result->target.x, 30, 5);
  EXPECT_NEAR(result->target.width, 65, 10);
}

TEST(ColourCalibration, ExactWithoutNoiseAndAmbientLight) {
  const auto result = calibrate_colour(all(250 / 0.98, 0, 0), {.saturated_share = 1});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_LT(result->residual, 0.6);  // what is left is rounding to 8 bits
  for (const ColourReport& r : result->colours) {
    if (r.colour == 0 || r.colour == 7) continue;
    EXPECT_GT(r.weakest_difference, 250);
    EXPECT_GT(r.weakest_difference, kDetectionThreshold);
  }
}

TEST(ColourCalibration, ComplementsMayBeMissing) {
  auto captures = all();
  std::erase_if(captures,
                [](const ColourCapture& c) { return c.colour == 3 || c.colour == 5 || c.colour == 6; });
  const auto result = calibrate_colour(captures, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->colours.size(), 5u);
  EXPECT_GT(result->colours[1].weakest_difference, 200);
}

TEST(ColourCalibration, AWeakChannelShowsInTheMargin) {
  auto captures = all();
  for (ColourCapture& c : captures) {  // a projector whose blue shines less in cyan
    if (c.colour != 6) continue;
    const Image8 green = capture(2).picture.clone();
    for (std::size_t i = 0; i < green.size(); ++i)
      c.picture.data()[i] =
          static_cast<std::uint8_t>((4 * int{c.picture.data()[i]} + 3 * int{green.data()[i]}) / 7);
  }
  const auto result = calibrate_colour(captures, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_GT(result->residual, kMostResidual);  // to be warned of
  const auto at = std::find_if(result->colours.begin(), result->colours.end(),
                               [](const ColourReport& r) { return r.colour == 6; });
  EXPECT_LT(at->weakest_difference, 200);
  EXPECT_EQ(at->weakest_channel, 2);
  EXPECT_GT(at->residual, 30);
}

TEST(ColourCalibration, ACurvedResponseIsToldByLightThatDoesNotAddUp) {
  for (const double gamma : {1.4, 2.2}) {
    auto captures = all();
    for (ColourCapture& c : captures)
      for (std::size_t i = 0; i < c.picture.size(); ++i)
        c.picture.data()[i] =
            static_cast<std::uint8_t>(std::lround(255 * std::pow(c.picture.data()[i] / 255.0, 1 / gamma)));
    const auto result = calibrate_colour(captures, {});
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_NEAR(result->camera.gamma, gamma, 0.05);
    EXPECT_LT(result->residual, 2);
    const auto as_is = calibrate_colour(captures, {.camera_gamma = 1});
    ASSERT_TRUE(as_is.ok()) << as_is.error().message;
    EXPECT_EQ(as_is->camera.gamma, 1);
    EXPECT_GT(as_is->residual, 8);
  }
  for (const double ambient : {0., 2., 20.}) {
    const auto straight = calibrate_colour(all(200, ambient), {});
    ASSERT_TRUE(straight.ok()) << straight.error().message;
    EXPECT_EQ(straight->camera.gamma, 1) << ambient;
  }
}

TEST(ColourCalibration, RefusesSaturation) {
  EXPECT_THAT(refusal(all(330)), HasSubstr("111.png: saturated, up to 100.0 %"));
  auto captures = all();
  captures[1] = capture(1, 400);
  EXPECT_THAT(refusal(captures), testing::StartsWith("100.png: saturated"));
}

TEST(ColourCalibration, RefusesUnderExposure) {
  EXPECT_THAT(refusal(all(40)), HasSubstr("111.png is under-exposed: the target reaches 4"));
  auto captures = all();
  captures[4].picture = capture(0).picture.clone();
  EXPECT_THAT(refusal(captures),
              HasSubstr("001.png is under-exposed: the target is hardly brighter than under black"));
}

TEST(ColourCalibration, RefusesTwoPicturesWithEachOthersNames) {
  const auto swapped = [](Primary a, Primary b) {
    auto captures = all();
    std::swap(captures[a].picture, captures[b].picture);
    return refusal(captures);
  };
  for (Primary a = 1; a < 7; ++a)
    for (Primary b = a + 1; b < 7; ++b)
      EXPECT_THAT(swapped(a, b), HasSubstr("the pictures of " + primary_name(a) + " and " + primary_name(b) +
                                           " seem to be swapped"));
}

TEST(ColourCalibration, RefusesAPictureOfAnotherColour) {
  auto captures = all();
  captures[6].picture = captures[2].picture.clone();
  EXPECT_THAT(refusal(captures), HasSubstr("011.png shows 010, by what the other captures show"));
  captures = all();
  captures.push_back({"100_2.png", 1, captures[3].picture.clone()});
  EXPECT_THAT(refusal(captures), HasSubstr("100_2.png shows 110, by what the other captures show"));
}

// Five captures hardly say which is wrong: they are taken as they are, with a residual to be warned of.
TEST(ColourCalibration, WhichOfFewCapturesIsWrongIsNotGuessed) {
  std::vector<ColourCapture> few;
  for (const Primary colour : {0, 1, 2, 4, 7}) few.push_back(capture(colour));
  few[1].picture = capture(3).picture.clone();
  const auto result = calibrate_colour(few, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_GT(result->residual, kMostResidual);
}

TEST(ColourCalibration, RefusesAmbientLight) {
  EXPECT_THAT(refusal(all(150, 80)), HasSubstr("000.png: the target is at 8"));
}

TEST(ColourCalibration, RefusesIncompleteSets) {
  auto captures = all();
  captures.erase(captures.begin());
  EXPECT_THAT(refusal(captures), HasSubstr("black, 000.png, is missing"));
  captures = all();
  captures.pop_back();
  EXPECT_THAT(refusal(captures), HasSubstr("white, 111.png, is missing"));
  std::vector<ColourCapture> few;
  for (const Primary colour : {0, 1, 6, 7}) few.push_back(capture(colour));
  EXPECT_THAT(refusal(few), HasSubstr("do not tell three colours apart"));
  captures = all();
  captures[3].picture = Image8(10, 10, 3);
  EXPECT_THAT(refusal(captures), HasSubstr("110.png is 10x10, 000.png 120x90"));
  EXPECT_THAT(refusal({}), HasSubstr("no captures"));
}

TEST(ColourCalibration, RefusesWhereThereIsNoTarget) {
  EXPECT_THAT(refusal(all(0)), HasSubstr("no white target is found"));
  EXPECT_THAT(refusal(all(), {.roi = Roi{100, 80, 50, 50}}), HasSubstr("not inside the pictures of 120x90"));
  constexpr int kMost = std::numeric_limits<int>::max();
  for (const Roi& roi : {Roi{kMost - 7, 0, 50, 50}, Roi{0, kMost - 7, 50, 50}, Roi{1, 1, kMost, kMost}})
    EXPECT_THAT(refusal(all(), {.roi = roi}), HasSubstr("not inside the pictures of 120x90"));
  EXPECT_THAT(refusal(all(), {.roi = Roi{40, 30, 1, 1}}),
              HasSubstr("the region given has 1 pixels, 200 are needed"));
  EXPECT_EQ(refusal(all(), {.roi = Roi{40, 30, 40, 30}}), "accepted");
}

TEST(ColourCalibration, NamesOfPrimaries) {
  for (Primary colour = 0; colour < 8; ++colour) EXPECT_EQ(primary_of(primary_name(colour)), colour);
  EXPECT_EQ(primary_name(1), "100");
  EXPECT_FALSE(primary_of("12"));
  EXPECT_FALSE(primary_of("102"));
}

}  // namespace
}  // namespace relievo
