// SPDX-License-Identifier: Apache-2.0
// What the frame before tells of a boundary, and luma as the camera gave it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "capture/reconstruct/continuity.h"
#include "capture/reconstruct/sharp_luma.h"
#include "tests/unit/capture/decoded_frame.h"

namespace relievo {
namespace {

constexpr int kLines = 20;
constexpr int kBoundaries = 12;
constexpr float kSpacing_px = 8;

float place(int boundary, float moved_px) {
  return 30 + kSpacing_px * static_cast<float>(boundary) + moved_px;
}

/// All of them `moved_px` to the right.
DecodedFrame surface(float moved_px) {
  return decoded_frame(kLines, kBoundaries, {.sigma_px = 0.05F, .contrast = 0.2F},
                       [&](int, int b) { return place(b, moved_px); });
}

std::size_t at(int line, int boundary) {
  return static_cast<std::size_t>(line * kBoundaries + boundary);
}

TEST(Continuity, AnUndecodedEdgeIsTheBoundaryThatMovedThere) {
  WorkerPool pool(1);
  Continuity continuity(kBoundaries, kLines);
  DecodedFrame before = surface(0);
  EXPECT_EQ(continuity.check({}, pool, before.result, before.edges).carried, 0U);
  DecodedFrame now = surface(1.5F);
  now.result.boundary[at(7, 5)] = -1;
  now.edges.edges[at(7, 5)].column_px += 0.3F;
  now.result.boundary[at(12, 3)] = -1;
  now.edges.edges[at(12, 3)].column_px += 2;  // elsewhere: not what was seen before
  const ContinuityCounts counts = continuity.check({}, pool, now.result, now.edges);
  EXPECT_EQ(counts.carried, 1U);
  EXPECT_EQ(counts.rejected, 0U);
  EXPECT_EQ(now.result.boundary[at(7, 5)], 5);
  EXPECT_NEAR(now.edges.edges[at(7, 5)].column_px, place(5, 1.5F), 0.2);
  EXPECT_EQ(now.result.boundary[at(12, 3)], -1);
}

TEST(Continuity, WhatWasCarriedOnceIsNotSeenAgain) {
  WorkerPool pool(1);
  Continuity continuity(kBoundaries, kLines);
  DecodedFrame first = surface(0);
  continuity.check({}, pool, first.result, first.edges);
  for (const std::size_t carried : {1U, 0U}) {
    DecodedFrame next = surface(0);
    next.result.boundary[at(7, 5)] = -1;
    EXPECT_EQ(continuity.check({}, pool, next.result, next.edges).carried, carried);
  }
}

TEST(Continuity, AnEndThatMovesUnlikeItsSurfaceIsGivenUp) {
  WorkerPool pool(1);
  Continuity continuity(kBoundaries, kLines);
  DecodedFrame before = surface(0);
  continuity.check({}, pool, before.result, before.edges);
  DecodedFrame now = surface(1);
  now.edges.edges[at(9, kBoundaries - 1)].column_px += 0.9F;  // at the surface's end
  now.edges.edges[at(9, 4)].column_px += 0.9F;                // amid it: other stages judge that
  now.edges.edges[at(15, 0)].column_px -= 0.9F;               // at an end where the scene moves
  now.result.still[at(15, 0)] = 0;
  const ContinuityCounts counts = continuity.check({}, pool, now.result, now.edges);
  EXPECT_EQ(counts.rejected, 2U);
  EXPECT_EQ(now.result.boundary[at(9, kBoundaries - 1)], -1);
  EXPECT_EQ(now.result.doubted[at(9, kBoundaries - 1)], kBoundaries - 1) << "others may yet confirm it";
  EXPECT_EQ(now.result.boundary[at(15, 0)], -1);
  EXPECT_EQ(now.result.doubted[at(15, 0)], -1);
  EXPECT_EQ(now.result.boundary[at(9, 4)], 4);
}

/// A grey surface twice as bright from column 10 on, lit from column 10.5 on by the slide and up to it by the
/// complement.
CapturedFrame lit(Scan scan, FieldOrder order) {
  CapturedFrame frame;
  frame.scan = scan;
  frame.field_order = order;
  frame.picture = Image8(24, 12, 3);
  if (scan == Scan::kProgressive) frame.complement = Image8(24, 12, 3);
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 24; ++x) {
      const int albedo = x < 10 ? 100 : 200;
      const float share = x <= 10 ? 0.F : 1.F;
      const auto paint = [&](Image8& to, float light) {
        for (int c = 0; c < 3; ++c)
          to.row(y)[3 * x + c] = static_cast<std::uint8_t>(static_cast<float>(albedo) * light);
      };
      const bool second = scan == Scan::kInterlaced && (y % 2 == 1) == (order == FieldOrder::kTop);
      paint(frame.picture, second ? 1 - share : share);
      if (scan == Scan::kProgressive) paint(frame.complement, 1 - share);
    }
  }
  return frame;
}

TEST(SharpLuma, RatioIsTheLightsOwnWhateverTheSurface) {
  for (const auto& [scan, order] : {std::pair{Scan::kProgressive, FieldOrder::kTop},
                                    {Scan::kInterlaced, FieldOrder::kTop},
                                    {Scan::kInterlaced, FieldOrder::kBottom}}) {
    const CapturedFrame frame = lit(scan, order);
    const SharpLuma sharp(frame);
    const int lines = scan == Scan::kProgressive ? 12 : 6;
    for (int line = 0; line < lines; ++line) {
      std::vector<float> ratio(16);
      sharp.ratio(line, 4, 16, 0, ratio.data());
      for (int i = 0; i < 16; ++i)
        EXPECT_NEAR(ratio[static_cast<std::size_t>(i)], i + 4 <= 10 ? -1 : 1, 1e-5);
    }
  }
}

}  // namespace
}  // namespace relievo
