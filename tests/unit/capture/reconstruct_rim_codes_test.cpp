// SPDX-License-Identifier: Apache-2.0
// Proves: a rim between stripes that the pattern has side by side is no boundary, where the stripe beside it
// is too narrow for more than the end of a surface; and other edges stay.
#include "capture/reconstruct/rim_codes.h"

#include <gtest/gtest.h>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

/// A line of two surfaces, the left one's boundaries 8 px apart up to `end`, the right one's 8 px from
/// `begin` on.
class RimTest : public ::testing::Test {
 protected:
  /// The scene is brighter from `step_px` on.
  std::size_t dropped(float end_px, int end, float begin_px, int begin, float step_px) {
    DifferenceImage image;
    image.width = 200;
    image.lines = 1;
    for (int x = 0; x < image.width; ++x)
      image.white.push_back(static_cast<float>(x) < step_px ? 100.F : 150.F);
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
    for (int i = 4; i > 0; --i) add(end - i, end_px - 1 - 8 * static_cast<float>(i));
    add(end, end_px);
    for (int i = 0; i < 4; ++i) add(begin + i, begin_px + 8 * static_cast<float>(i));
    edges.line_start = {0, static_cast<std::uint32_t>(edges.edges.size())};
    PlaceGrid places;
    places.fill(static_cast<int>(shown_.size()), pool_, result_, edges, recovered_);
    return drop_rims(image, shown_, shown_, pool_, places, result_, edges, recovered_);
  }
  /// A later boundary whose left stripe looks like the right one of `boundary`, or does not.
  int meets(int boundary, bool alike) const {
    for (std::size_t b = static_cast<std::size_t>(boundary) + 8; b < shown_.size(); ++b)
      if ((shown_[b][0] == shown_[static_cast<std::size_t>(boundary)][1]) == alike)
        return static_cast<int>(b);
    return -1;
  }

  const SequenceDecoder sequence_{*make_pattern(6, 2, 3, 90)};
  const StripeColours& shown_ = sequence_.shown_colours(SlideOrder::kNewerIsFirst);
  WorkerPool pool_{1};
  SequenceResult result_;
  std::vector<RecoveredBoundary> recovered_;
};

TEST_F(RimTest, ARimBetweenStripesThatArePartOfThePatternIsDropped) {
  EXPECT_EQ(dropped(100, 10, 108.8F, meets(10, true), 100), 1U);  // the right one's would be to its left
  EXPECT_EQ(result_.boundary[4], -1);
  EXPECT_EQ(dropped(100, 10, 106, meets(10, true), 106),
            1U);  // the left surface's next one would be to its right
  EXPECT_EQ(result_.boundary[5], -1);
}

TEST_F(RimTest, WhereThereIsRoomForTheNextBoundaryItIsNone) {
  EXPECT_EQ(dropped(100, 10, 112, meets(10, true), 100), 0U);
}

TEST_F(RimTest, WhereTheSurfaceEndsFurtherOnItIsNone) {
  EXPECT_EQ(dropped(100, 10, 108.8F, meets(10, true), 105), 0U);
}

TEST_F(RimTest, OtherColoursAreAnotherEdge) {
  EXPECT_EQ(dropped(100, 10, 108.8F, meets(10, false), 100), 0U);
}

}  // namespace
}  // namespace relievo
