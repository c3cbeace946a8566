// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/half_way.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace relievo {
namespace {

constexpr int kLines = 12;
constexpr int kBoundaries = 30;
constexpr int kWidth_px = 320;
constexpr std::int64_t kFrame_ns = 33'366'700;

struct Place {
  float column_px, sigma_px;
};

/// Nothing on it.
DecodedGrid blank() {
  DecodedGrid out;
  out.reset(kBoundaries, kLines);
  return out;
}
/// Boundaries [first, last], 10 px apart, on every line.
void add(DecodedGrid& frame, int first, int last, float moved_px) {
  for (int line = 0; line < kLines; ++line)
    for (int b = first; b <= last; ++b)
      frame.put(line, b, 20 + 10 * static_cast<float>(b) + moved_px, 0.04F, 1);
}
void lose(DecodedGrid& frame, int line, int boundary) {
  frame.column_px(line)[boundary] = kNoColumn;
}
std::optional<Place> at(const DecodedGrid& frame, int line, int boundary) {
  const float column_px = frame.column_px(line)[boundary];
  if (std::isnan(column_px)) return std::nullopt;
  return Place{column_px, frame.sigma_px(line)[boundary]};
}
int known(const DecodedGrid& frame) {
  int out = 0;
  for (int line = 0; line < kLines; ++line)
    for (int b = 0; b < kBoundaries; ++b) out += at(frame, line, b).has_value();
  return out;
}

class HalfWayTest : public ::testing::Test {
 protected:
  /// Of two frames that follow each other.
  DecodedGrid between(const DecodedGrid& first, const DecodedGrid& second) {
    DecodedGrid out = blank();
    out.put(3, 3, 77, 0, 1);  // of an older frame
    EXPECT_FALSE(half_way_.place(first, kFrame_ns, kFrame_ns * 3 / 2, out));
    EXPECT_TRUE(half_way_.place(second, 2 * kFrame_ns, kFrame_ns * 3 / 2, out));
    return out;
  }

  HalfWay half_way_{kBoundaries, kLines, kWidth_px};
};

// What moved on beyond the picture's edge was beyond it half way already: a stream has no place for it.
TEST_F(HalfWayTest, NothingIsBesideThePicture) {
  DecodedGrid first = blank(), second = blank();
  add(first, 0, kBoundaries - 1, -18);
  add(second, 1, kBoundaries - 1, -24);
  const DecodedGrid left = between(first, second);
  EXPECT_FALSE(at(left, 5, 0));  // at -1
  EXPECT_TRUE(at(left, 5, 1));
  first = blank(), second = blank();
  half_way_ = HalfWay(kBoundaries, kLines, kWidth_px);
  add(first, 0, kBoundaries - 1, 8);
  add(second, 0, kBoundaries - 2, 14);
  const DecodedGrid right = between(first, second);
  EXPECT_FALSE(at(right, 5, kBoundaries - 1));  // at 321
  EXPECT_TRUE(at(right, 5, kBoundaries - 2));
}

TEST_F(HalfWayTest, WhatBothFramesHaveIsBetweenItsColumns) {
  DecodedGrid first = blank(), second = blank();
  add(first, 0, 9, 0);
  add(second, 0, 9, 3);
  const auto out = between(first, second);
  ASSERT_EQ(known(out), known(first));
  EXPECT_NEAR(at(out, 5, 4)->column_px, 61.5, 1e-4);
  EXPECT_NEAR(at(out, 5, 4)->sigma_px, 0.04 / 1.41421, 1e-4);
}

TEST_F(HalfWayTest, WhatOneHasGoesAsItsNeighboursDo) {
  DecodedGrid first = blank(), second = blank();
  add(first, 0, 9, 0);
  add(second, 0, 9, 3);
  lose(first, 5, 4);
  lose(second, 8, 9);
  const auto out = between(first, second);
  ASSERT_TRUE(at(out, 5, 4));
  EXPECT_NEAR(at(out, 5, 4)->column_px, 61.5, 1e-4);
  ASSERT_TRUE(at(out, 8, 9));
  EXPECT_NEAR(at(out, 8, 9)->column_px, 111.5, 1e-4);
  EXPECT_GT(at(out, 8, 9)->sigma_px, 0.1F);
}

TEST_F(HalfWayTest, WhatAnotherSurfacePassesIsNotTakenToBeSeen) {
  DecodedGrid first = blank(), second = blank();
  add(first, 0, 12, 0);
  add(second, 0, 11, 0);  // the last one is covered
  add(first, 20, 25, -65);
  add(second, 20, 25, -71);
  EXPECT_FALSE(at(between(first, second), 5, 12));
}

TEST_F(HalfWayTest, NorWhatNothingTellsTheWayOf) {
  DecodedGrid first = blank(), second = blank();
  add(first, 0, 9, 0);
  add(second, 0, 3, 3);
  const auto out = between(first, second);
  EXPECT_TRUE(at(out, 5, 4));
  EXPECT_FALSE(at(out, 5, 8));
}

TEST_F(HalfWayTest, TheFirstFrameMayBeOfTime0) {
  DecodedGrid frame = blank(), out = blank();
  add(frame, 0, 9, 0);
  EXPECT_FALSE(half_way_.place(frame, 0, kFrame_ns * 3 / 2, out));
  EXPECT_TRUE(half_way_.place(frame, kFrame_ns, kFrame_ns * 3 / 2, out));
  EXPECT_EQ(known(out), 10 * kLines);
}

TEST_F(HalfWayTest, OverALostFrameNothingIsPlaced) {
  DecodedGrid frame = blank(), out = blank();
  add(frame, 0, 9, 0);
  half_way_.place(frame, kFrame_ns, kFrame_ns * 3 / 2, out);
  EXPECT_FALSE(half_way_.place(frame, 3 * kFrame_ns, kFrame_ns * 3 / 2, out));
  EXPECT_EQ(known(out), 0);
}

}  // namespace
}  // namespace relievo
