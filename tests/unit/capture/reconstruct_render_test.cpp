// SPDX-License-Identifier: Apache-2.0
// Places by the picture that they would give: every set of instructions against the portable one; where a
// picture is known, a place is found, and a boundary that was given up is taken back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/render_place.h"
#include "capture/reconstruct/stripe_end.h"
#include "tests/unit/capture/decoded_frame.h"

namespace relievo {
namespace {

TEST(RowComparisons, AllGiveWhatThePortableOneDoes) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> value(-200, 200);
  std::uniform_real_distribution<float> share(0, 1);
  const auto fill = [&](auto& row, auto& distribution) {
    for (float& v : row) v = distribution(random);
  };
  for (int i = 0; i < 200; ++i) {
    RenderedRow row;
    row.first_px = 100;
    for (auto* in : {&row.base[0], &row.base[1], &row.rise[0], &row.rise[1]}) fill(*in, value);
    for (auto* out : {&row.luma_base, &row.luma_rise, &row.luma, &row.chroma[0], &row.chroma[1]})
      fill(*out, value);
    for (auto* out : {&row.scale, &row.weight}) fill(*out, share);
    fill(row.blur, share);
    const float column = 90 + 40 * share(random);
    const float expected = row_comparisons().front().unlike(row, column);
    for (const RowComparison& comparison : row_comparisons())
      EXPECT_EQ(comparison.unlike(row, column), expected) << comparison.name;
  }
}

constexpr int kLines = 8;
constexpr int kBoundaries = 12;
constexpr int kWidth = 160;
constexpr float kBlur_px = 1;

float place_of(int boundary) {
  return 30.3F + 8.1F * static_cast<float>(boundary);
}

/// A surface of two brightnesses under a pattern's first stripes, its boundaries all where place_of() has
/// them, as a camera shows it that blurs colour.
class RenderTest : public ::testing::Test {
 protected:
  RenderTest()
      : decoded_(
            decoded_frame(kLines, kBoundaries, {.sigma_px = 0.02F}, [](int, int b) { return place_of(b); })) {
    frame_.scan = Scan::kProgressive;
    frame_.picture = Image8(kWidth, kLines, 3);
    frame_.complement = Image8(kWidth, kLines, 3);
    for (const bool slide : {true, false}) draw(slide, slide ? frame_.picture : frame_.complement);
    moving_.find(kWidth, decoded_.result, decoded_.edges);
  }

  const std::vector<std::array<Primary, 2>>& colours() const {
    return sequence_.shown_colours(SlideOrder::kNewerIsFirst);
  }
  void draw(bool slide, Image8& out) const {
    std::array<std::array<float, 3>, kWidth> sharp{};
    for (int x = 0; x < kWidth; ++x) {
      const float brightness = x < step_px_ ? 90.F : 180.F;
      for (std::size_t c = 0; c < 3; ++c) {
        float light = static_cast<float>(colours()[0][0] >> c & 1);
        for (int b = 0; b < kBoundaries; ++b) {
          const auto& [left, right] = colours()[static_cast<std::size_t>(b)];
          light += (static_cast<float>(right >> c & 1) - static_cast<float>(left >> c & 1)) *
                   behind_end(static_cast<float>(x) - place_of(b));
        }
        sharp[static_cast<std::size_t>(x)][c] = brightness * (slide ? light : 1 - light);
      }
    }
    const auto luma = [&](int x) {
      const auto& p = sharp[static_cast<std::size_t>(x)];
      return 0.299F * p[0] + 0.587F * p[1] + 0.114F * p[2];
    };
    for (int x = 0; x < kWidth; ++x) {
      std::array<float, 3> chroma{};
      float weights = 0;
      for (int i = std::max(0, x - 5); i <= std::min(kWidth - 1, x + 5); ++i) {
        const float off = static_cast<float>(i - x) / kBlur_px;
        const float weight = std::exp(-0.5F * off * off);
        weights += weight;
        for (std::size_t c = 0; c < 3; ++c)
          chroma[c] += weight * (sharp[static_cast<std::size_t>(i)][c] - luma(i));
      }
      for (int y = 0; y < kLines; ++y)
        for (std::size_t c = 0; c < 3; ++c)
          out.row(y)[3 * x + static_cast<int>(c)] =
              static_cast<std::uint8_t>(std::clamp(luma(x) + chroma[c] / weights + 0.5F, 0.F, 255.F));
    }
  }
  Edge& edge(int line, int boundary) { return decoded_.edges.edges[at(line, boundary)]; }
  std::int16_t& boundary(int line, int b) { return decoded_.result.boundary[at(line, b)]; }
  static std::size_t at(int line, int b) { return static_cast<std::size_t>(line * kBoundaries + b); }

  RenderCounts place() {
    decoded_.result.doubted.assign(decoded_.result.boundary.size(), -1);
    places_.fill(kBoundaries, pool_, decoded_.result, decoded_.edges, recovered_);
    return RenderPlacer({1, 0, 0, 0, 1, 0, 0, 0, 1})
        .place({.rows = frame_,
                .colours = colours(),
                .places = places_,
                .moving = moving_,
                .blur_px = kBlur_px,
                .ambient = 0},
               pool_, decoded_.result, decoded_.edges, recovered_);
  }

  const float step_px_ = place_of(5) + 1;  // where the surface is brighter
  const SequenceDecoder sequence_{*make_pattern(6, 2, 0, 90)};
  WorkerPool pool_{2};
  DecodedFrame decoded_;
  CapturedFrame frame_;
  MovingPlaces moving_;
  PlaceGrid places_;
  std::vector<RecoveredBoundary> recovered_;
};

TEST_F(RenderTest, AnUnsurePlaceGoesWhereThePictureHasIt) {
  for (const float off : {-0.5F, 0.4F}) {
    edge(3, 5).column_px = place_of(5) + off;
    edge(3, 5).sigma_px = 0.3F;
    EXPECT_EQ(place().moved, 1U);
    EXPECT_NEAR(edge(3, 5).column_px, place_of(5), 0.15F) << off;
  }
}

TEST_F(RenderTest, ASurePlaceStays) {
  edge(3, 5).column_px += 0.4F;
  const float before = edge(3, 5).column_px;
  EXPECT_EQ(place().moved, 0U);
  EXPECT_EQ(edge(3, 5).column_px, before);
}

TEST_F(RenderTest, WhatALineBesideHasAndThePictureShowsIsTakenBack) {
  boundary(3, 4) = -1;
  EXPECT_EQ(place().restored, 1U);
  ASSERT_EQ(recovered_.size(), 1U);
  EXPECT_EQ(recovered_[0].boundary, 4);
  EXPECT_NEAR(recovered_[0].column_px, place_of(4), 0.1F);
}

TEST_F(RenderTest, BesideAShadowNothingIsTakenBack) {
  boundary(3, 4) = -1;
  for (Image8* picture : {&frame_.picture, &frame_.complement})
    std::fill(picture->row(3) + 3 * (static_cast<int>(place_of(4)) + 1), picture->row(3) + 3 * kWidth,
              std::uint8_t{20});
  EXPECT_EQ(place().restored, 0U);
}

TEST_F(RenderTest, AtTheEndOfALineNothingIsTakenBack) {
  boundary(3, kBoundaries - 1) = -1;
  EXPECT_EQ(place().restored, 0U);
}

}  // namespace
}  // namespace relievo
