// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/half_way.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

namespace relievo {
namespace {

constexpr int kLines = 12;
constexpr int kBoundaries = 30;
constexpr std::int64_t kFrame_ns = 33'366'700;

/// Boundaries [first, last], 10 px apart, on every line.
void add(std::vector<DecodedBoundary>& frame, int first, int last, float moved_px) {
  for (int line = 0; line < kLines; ++line)
    for (int b = first; b <= last; ++b)
      frame.push_back({b, line, 20 + 10 * static_cast<float>(b) + moved_px, 0.04F, 1});
}
void lose(std::vector<DecodedBoundary>& frame, int line, int boundary) {
  std::erase_if(frame, [&](const DecodedBoundary& b) { return b.line == line && b.boundary == boundary; });
}
std::optional<DecodedBoundary> at(const std::vector<DecodedBoundary>& frame, int line, int boundary) {
  const auto found = std::ranges::find_if(
      frame, [&](const DecodedBoundary& b) { return b.line == line && b.boundary == boundary; });
  return found == frame.end() ? std::nullopt : std::optional(*found);
}

class HalfWayTest : public ::testing::Test {
 protected:
  /// Of two frames that follow each other.
  std::vector<DecodedBoundary> between(const std::vector<DecodedBoundary>& first,
                                       const std::vector<DecodedBoundary>& second) {
    std::vector<DecodedBoundary> out;
    EXPECT_FALSE(half_way_.place(first, kFrame_ns, kFrame_ns * 3 / 2, out));
    EXPECT_TRUE(half_way_.place(second, 2 * kFrame_ns, kFrame_ns * 3 / 2, out));
    return out;
  }

  HalfWay half_way_{kBoundaries, kLines};
};

TEST_F(HalfWayTest, WhatBothFramesHaveIsBetweenItsColumns) {
  std::vector<DecodedBoundary> first, second;
  add(first, 0, 9, 0);
  add(second, 0, 9, 3);
  const auto out = between(first, second);
  ASSERT_EQ(out.size(), first.size());
  EXPECT_NEAR(at(out, 5, 4)->column_px, 61.5, 1e-4);
  EXPECT_NEAR(at(out, 5, 4)->sigma_px, 0.04 / 1.41421, 1e-4);
}

TEST_F(HalfWayTest, WhatOneHasGoesAsItsNeighboursDo) {
  std::vector<DecodedBoundary> first, second;
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
  std::vector<DecodedBoundary> first, second;
  add(first, 0, 12, 0);
  add(second, 0, 11, 0);  // the last one is covered
  add(first, 20, 25, -65);
  add(second, 20, 25, -71);
  EXPECT_FALSE(at(between(first, second), 5, 12));
}

TEST_F(HalfWayTest, NorWhatNothingTellsTheWayOf) {
  std::vector<DecodedBoundary> first, second;
  add(first, 0, 9, 0);
  add(second, 0, 3, 3);
  const auto out = between(first, second);
  EXPECT_TRUE(at(out, 5, 4));
  EXPECT_FALSE(at(out, 5, 8));
}

TEST_F(HalfWayTest, OverALostFrameNothingIsPlaced) {
  std::vector<DecodedBoundary> frame, out;
  add(frame, 0, 9, 0);
  half_way_.place(frame, kFrame_ns, kFrame_ns * 3 / 2, out);
  EXPECT_FALSE(half_way_.place(frame, 3 * kFrame_ns, kFrame_ns * 3 / 2, out));
  EXPECT_TRUE(out.empty());
}

}  // namespace
}  // namespace relievo
