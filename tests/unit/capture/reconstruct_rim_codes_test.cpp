// SPDX-License-Identifier: Apache-2.0
// Proves: a rim between stripes that the pattern has side by side under a slide is no boundary, where the
// stripe beside it is too narrow for more than the end of a surface and the scene changes there; and other
// edges stay.
#include "capture/reconstruct/rim_codes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

/// A line of two surfaces, the left one's boundaries 8 px apart up to `end`, the right one's 8 px from
/// `begin` on.
class RimTest : public ::testing::Test {
 protected:
  /// From `step_px` on the scene is brighter, and from `colour_px` on of another colour.
  std::size_t dropped(float end_px, int end, float begin_px, int begin, float step_px,
                      float colour_px = kWidth) {
    DifferenceImage image;
    image.width = kWidth;
    image.lines = 1;
    for (int i = 0; i < 3 * kWidth; ++i)
      image.values.push_back(static_cast<float>(i % kWidth) < shadow_px_ ? 50.F : 0.5F);
    CapturedFrame frame{.scan = Scan::kProgressive};
    frame.picture = Image8(kWidth, 1, 3);
    for (int x = 0; x < kWidth; ++x) {
      image.white.push_back(static_cast<float>(x) < step_px ? 100.F : 150.F);
      const bool grey = static_cast<float>(x) >= colour_px;
      const std::array<std::uint8_t, 3> rgb{grey ? std::uint8_t{100} : std::uint8_t{120}, 100,
                                            grey ? std::uint8_t{100} : std::uint8_t{80}};
      std::copy(rgb.begin(), rgb.end(), frame.picture.row(0) + 3 * x);
    }
    frame.complement = frame.picture.clone();
    EdgeImage edges;
    edges.lines = 1;
    result_ = {};
    const auto add = [&](int boundary, float column_px) {
      Edge edge;
      edge.column_px = column_px;
      edge.sigma_px = 0.1F;
      edges.edges.push_back(edge);
      result_.boundary.push_back(static_cast<std::int16_t>(boundary));
    };
    for (int i = 4; i > 0; --i) add(end - i, end_px - foretold_off_px_ - 8 * static_cast<float>(i));
    add(end, end_px);
    for (int i = 0; i < 4; ++i) add(begin + i, begin_px + 8 * static_cast<float>(i));
    edges.line_start = {0, static_cast<std::uint32_t>(edges.edges.size())};
    PlaceGrid places;
    places.fill(static_cast<int>(shown_.size()), pool_, result_, edges, recovered_);
    return drop_rims(DetectionLines(frame), image, shown_, other_, front_, pool_, places, result_, edges,
                     recovered_);
  }
  /// A later boundary whose left stripe looks like the right one of `boundary`, in one slide or the other.
  int meets(int boundary, bool in_shown, bool in_other) const {
    const auto own = static_cast<std::size_t>(boundary);
    for (std::size_t b = own + 8; b + 4 < shown_.size(); ++b)
      if ((shown_[b][0] == shown_[own][1]) == in_shown && (other_[b][0] == other_[own][1]) == in_other)
        return static_cast<int>(b);
    return -1;
  }

  static constexpr int kWidth = 200;
  int front_ = -1;             // the left surface
  float shadow_px_ = kWidth;   // from here on
  float foretold_off_px_ = 1;  // the left surface's last place
  const SequenceDecoder sequence_{*make_pattern(6, 2, 3, 90)};
  const StripeColours& shown_ = sequence_.shown_colours(SlideOrder::kNewerIsFirst);
  const StripeColours& other_ = sequence_.shown_colours(SlideOrder::kNewerIsSecond);
  WorkerPool pool_{1};
  SequenceResult result_;
  std::vector<RecoveredBoundary> recovered_;
};

TEST_F(RimTest, ARimBetweenStripesThatArePartOfThePatternIsDropped) {
  const int k = meets(10, true, true);
  ASSERT_GT(k, 0);
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 100), 1U);  // the right one's would be to its left
  EXPECT_EQ(result_.boundary[4], -1);
  EXPECT_EQ(dropped(100, 10, 106, k, 106), 1U);  // the left surface's next one would be to its right
  EXPECT_EQ(result_.boundary[5], -1);
}

TEST_F(RimTest, WithTheProjectorOnTheOtherSideTheRightSurfaceIsInFront) {
  const int k = meets(10, true, true);
  ASSERT_GT(k, 0);
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 108.8F), 0U);
  EXPECT_EQ(dropped(100, 10, 106, k, 100), 0U);
  front_ = 1;
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 108.8F), 1U);  // the left one's next one would be to its right
  EXPECT_EQ(result_.boundary[5], -1);
  EXPECT_EQ(dropped(100, 10, 106, k, 100), 1U);  // the right one's would be to its left
  EXPECT_EQ(result_.boundary[4], -1);
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 100), 0U);
}

TEST_F(RimTest, WhereThereIsRoomForTheNextBoundaryItIsNone) {
  EXPECT_EQ(dropped(100, 10, 112, meets(10, true, true), 100), 0U);
}

TEST_F(RimTest, WhereTheSurfaceEndsFurtherOnItIsNone) {
  EXPECT_EQ(dropped(100, 10, 108.8F, meets(10, true, true), 105), 0U);
}

TEST_F(RimTest, WhatOneSlideShowsIsARimWhereTheScenesColourChanges) {
  for (const bool in_shown : {true, false}) {
    const int k = meets(10, in_shown, !in_shown);
    ASSERT_GT(k, 0);
    EXPECT_EQ(dropped(100, 10, 108.8F, k, 100), 0U);  // brightness alone may be the surface's own
    EXPECT_EQ(dropped(100, 10, 108.8F, k, 100, 100), 1U);
    EXPECT_EQ(result_.boundary[4], -1);
    EXPECT_EQ(dropped(100, 10, 108.8F, k, 100, 105), 0U);  // it ends further on
    EXPECT_EQ(dropped(100, 10, 106, k, 106, 106), 1U);
    EXPECT_EQ(result_.boundary[5], -1);
  }
}

TEST_F(RimTest, OtherColoursAreARimOnlyFarFromWhereTheSurfaceForetellsIt) {
  const int k = meets(10, false, false);
  ASSERT_GT(k, 0);
  foretold_off_px_ = 0.9F;
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 100, 100), 0U);
  foretold_off_px_ = 1.5F;
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 100, 100), 1U);
  EXPECT_EQ(dropped(100, 10, 108.8F, k, 100), 0U);
}

TEST_F(RimTest, ASliverOfTheBackTellsNothingOfTheFrontsColours) {
  const int k = meets(10, true, true);
  foretold_off_px_ = 0.9F;
  EXPECT_EQ(dropped(100, 10, 103, k, 100, 100), 0U);
  foretold_off_px_ = 1.5F;
  EXPECT_EQ(dropped(100, 10, 103, k, 100, 100), 1U);
  EXPECT_EQ(result_.boundary[4], -1);
}

TEST_F(RimTest, NoLastBoundaryLiesInAShadow) {
  const int k = meets(10, false, false);  // the last boundary is at 136
  shadow_px_ = 138;
  EXPECT_EQ(dropped(100, 10, 112, k, kWidth), 0U);
  shadow_px_ = 136;
  EXPECT_EQ(dropped(100, 10, 112, k, kWidth), 1U);
  EXPECT_EQ(result_.boundary[8], -1);
  shadow_px_ = 108;  // where both its sides are as dark it was found all the same
  EXPECT_EQ(dropped(100, 10, 112, k, kWidth), 0U);
}

}  // namespace
}  // namespace relievo
