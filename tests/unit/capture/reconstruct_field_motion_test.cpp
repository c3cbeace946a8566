// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/field_motion.h"

namespace relievo {
namespace {

constexpr int kWidth = 320;
constexpr int kLines = 64;
constexpr float kStripe_px = 8;
constexpr std::array<int, 6> kColours{1, 2, 4, 6, 5, 3};
constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};

/// 0..1: of a channel at a place under the stripes, whose boundaries are a pixel wide.
float lit(float column_px, int channel) {
  float sum = 0;
  for (const float off : {-0.4F, -0.2F, 0.F, 0.2F, 0.4F}) {
    // No two stretches of the stripes look alike.
    const int stripe = static_cast<int>(std::floor((column_px + off) / kStripe_px)) + 100;
    const int colour = kColours[static_cast<std::size_t>((stripe + stripe * stripe / 7) % 6)];
    sum += static_cast<float>(colour >> channel & 1);
  }
  return sum / 5;
}

/// A field of lines whose stripes are `moved_px` further on at each column.
template <typename Moved>
Image8 field(bool complement, const Moved& moved_px, float noise = 1.5F) {
  std::mt19937 random(complement ? 3 : 5);
  std::normal_distribution<float> error(0, std::max(noise, 1e-3F));
  Image8 out(kWidth, kLines, 3);
  for (int y = 0; y < kLines; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float own = lit(static_cast<float>(x) - moved_px(x), c);
        const float value = 20 + 160 * (complement ? 1 - own : own) + error(random);
        out.row(y)[3 * x + c] = static_cast<std::uint8_t>(std::clamp(value, 0.F, 255.F));
      }
    }
  }
  return out;
}

float none(int) {
  return 0;
}

FieldMotion found(const Image8& slide, const Image8& complement) {
  WorkerPool pool(2);
  FieldMotion motion;
  MotionFinder().find(slide.view(), complement.view(), pool, motion);
  return motion;
}

TEST(FieldMotion, IsNoneWhereNothingMoves) {
  EXPECT_TRUE(found(field(false, none), field(true, none)).moves.empty());
  const Image8 grey(kWidth, kLines, 3);
  EXPECT_TRUE(found(grey, grey).moves.empty()) << "nor where there are no stripes";
}

TEST(FieldMotion, IsWhatTheStripesMovedBy) {
  for (const float px : {-5.F, -2.6F, -1.F, 1.3F, 3.F, 4.7F}) {
    const auto motion = found(field(false, none), field(true, [px](int) { return px; }));
    ASSERT_FALSE(motion.moves.empty()) << px;
    for (int line = 0; line < kLines; line += 5)
      for (int x = 40; x < kWidth - 40; x += 7) EXPECT_NEAR(motion.at(line, static_cast<float>(x)), px, 0.3F);
  }
}

TEST(FieldMotion, TellsWhatMovesFromWhatHoldsStill) {
  const auto motion =
      found(field(false, none), field(true, [](int x) { return x < kWidth / 2 ? 0.F : 4.F; }));
  for (const int x : {30, 60, 90, 120}) EXPECT_EQ(motion.at(20, static_cast<float>(x)), 0) << x;
  for (const int x : {200, 230, 260}) EXPECT_NEAR(motion.at(20, static_cast<float>(x)), 4, 0.3) << x;
}

TEST(FieldMotion, BetweenFramesIsTheMeanOfBoth) {
  FieldMotion now, before;
  now.cells = before.cells = 20;
  now.px.assign(20, 3.F);
  before.px.assign(20, 2.F);
  now.moves = before.moves = {1};
  EXPECT_NEAR(now.between_frames(before, 4, 100, 2), 5, 1e-5);
  before.px.assign(20, -3.F);  // another surface
  EXPECT_NEAR(now.between_frames(before, 4, 100, 2), 6, 1e-5);
}

TEST(AlignedDifference, HasBoundariesHalfWayBetweenTheFields) {
  constexpr float kMoved_px = 4;
  CapturedFrame frame;
  frame.scan = Scan::kProgressive;
  frame.picture = field(false, none, 0);
  frame.complement = field(
      true, [](int) { return kMoved_px; }, 0);
  WorkerPool pool(1);
  Differencer differencer(kIdentity);
  DifferenceImage image;
  differencer.aligned_difference(frame, pool, image);
  EdgeImage edges;
  EdgeFinder().find(image, pool, edges);
  std::size_t seen = 0;
  for (const Edge& edge : edges.edges) {
    if (edge.column_px < 30 || edge.column_px > kWidth - 30) continue;
    const float off = edge.column_px - 0.5F * kMoved_px + 0.5F;
    EXPECT_NEAR(off, kStripe_px * std::round(off / kStripe_px), 0.6) << edge.column_px;
    ++seen;
  }
  EXPECT_GE(seen, 28U * kLines) << "of each boundary one, of those between stripes alike none";
}

}  // namespace
}  // namespace relievo
