// SPDX-License-Identifier: Apache-2.0
// Depths that the frame before saw: of other boundaries, too, near a place and not far from it.
#include "capture/reconstruct/seen_depths.h"

#include <gtest/gtest.h>

#include <limits>

namespace relievo {
namespace {

constexpr int kBoundaries = 40;
constexpr int kLines = 64;
constexpr float kPitch_px = 8;
constexpr float kRange_px = 128;  // from the farthest place of a boundary to the nearest one
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

float farthest_px(int boundary) {
  return 100 + kPitch_px * static_cast<float>(boundary);
}

/// Boundaries 20 to 23 are 60 px from their farthest places, on lines 16 to 47.
SeenDepths seen() {
  std::vector<float> before_px(static_cast<std::size_t>(kLines * kBoundaries), kNone);
  for (int line = 16; line < 48; ++line)
    for (int b = 20; b < 24; ++b)
      before_px[static_cast<std::size_t>(line * kBoundaries + b)] = farthest_px(b) + 60;
  std::vector<ColumnRange> columns;
  for (int b = 0; b < kBoundaries; ++b) columns.push_back({farthest_px(b), farthest_px(b) + kRange_px});
  columns.back() = {-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};
  FieldMotion motion;
  motion.cells = 640 / FieldMotion::kCellWidth;
  SeenDepths out;
  out.fill(before_px, columns, motion);
  return out;
}

TEST(SeenDepths, OfASurfaceHasBoundariesThatItDidNotShow) {
  const SeenDepths depths = seen();
  for (const int b : {18, 19, 20, 23, 24, 25}) {
    EXPECT_TRUE(depths.has(30, b, farthest_px(b) + 60)) << b;
    EXPECT_TRUE(depths.has(30, b, farthest_px(b) + 62)) << "a little nearer";
    EXPECT_FALSE(depths.has(30, b, farthest_px(b) + 70)) << "much nearer";
    EXPECT_FALSE(depths.has(30, b, farthest_px(b) + 50)) << "much farther";
  }
}

TEST(SeenDepths, AreThoseNearAPlace) {
  const SeenDepths depths = seen();
  EXPECT_TRUE(depths.has(9, 21, farthest_px(21) + 60)) << "the lines beside";
  EXPECT_FALSE(depths.has(60, 21, farthest_px(21) + 60)) << "far below";
  EXPECT_FALSE(depths.has(30, 30, farthest_px(30) + 60)) << "far to the right";
  EXPECT_FALSE(depths.has(30, 10, farthest_px(10) + 60)) << "far to the left";
}

TEST(SeenDepths, NothingIsKnownWhereNoPlaceIsExpectedOrOutsideThePicture) {
  SeenDepths depths = seen();
  EXPECT_FALSE(depths.has(30, kBoundaries - 1, farthest_px(21) + 60));
  EXPECT_FALSE(depths.has(30, 21, 5000));
  EXPECT_FALSE(depths.has(500, 21, farthest_px(21) + 60));
  depths.clear();
  EXPECT_FALSE(depths.has(30, 21, farthest_px(21) + 60));
}

}  // namespace
}  // namespace relievo
