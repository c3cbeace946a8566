// SPDX-License-Identifier: Apache-2.0
// What is done once all boundaries of a frame are found: carried from the frame before, and weighed.
#include "capture/reconstruct/weigh.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/persistence.h"
#include "tests/unit/capture/decoded_frame.h"

namespace relievo {
namespace {

constexpr int kLines = 20;
constexpr int kBoundaries = 12;
constexpr int kWidth_px = 200;

/// Boundaries 8 px apart that lean by 0.3 px a line, all decoded and sure of their places.
struct Frame : DecodedFrame {
  std::vector<RecoveredBoundary> recovered;
  WorkerPool pool{2};
  PlaceGrid places;

  explicit Frame(float moved_px = 0)
      : DecodedFrame(decoded_frame(kLines, kBoundaries, {.sigma_px = 0.02F},
                                   [&](int line, int b) { return place(line, b) + moved_px; })) {}

  static float place(int line, int boundary) {
    return 30 + 8 * static_cast<float>(boundary) + 0.3F * static_cast<float>(line);
  }
  static std::size_t at(int line, int boundary) {
    return static_cast<std::size_t>(line * kBoundaries + boundary);
  }
  Edge& edge(int line, int boundary) { return edges.edges[at(line, boundary)]; }
  void lose(int line, int boundary) { result.boundary[at(line, boundary)] = -1; }
  void move(int line, int boundary, float px, float sigma_px) {
    edge(line, boundary).column_px += px;
    edge(line, boundary).sigma_px = sigma_px;
  }
  void fill() { places.fill(kBoundaries, pool, result, edges, recovered); }
  MovingPlaces moving() const {
    MovingPlaces out;
    out.find(kWidth_px, result, edges);
    return out;
  }
  WeighingCounts weigh() {
    fill();
    return Weighing().weigh(places, moving(), 1, pool, result, edges, recovered);
  }
  std::size_t carry(Persistence& persistence) {
    fill();
    return persistence.carry(moving(), pool, places, recovered);
  }
};

TEST(Weighing, AnUnsurePlaceGoesToWhatItsNeighboursForetell) {
  Frame f;
  f.move(7, 5, 0.4F, 0.3F);
  f.lose(9, 0);
  f.recovered.push_back({9, 0, Frame::place(9, 0) - 0.4F, 0.3F, 0});
  const WeighingCounts counts = f.weigh();
  EXPECT_EQ(counts.moved, 2U);
  EXPECT_EQ(counts.rejected, 0U);
  EXPECT_NEAR(f.edge(7, 5).column_px, Frame::place(7, 5), 0.05);
  EXPECT_LT(f.edge(7, 5).sigma_px, 0.1F);
  ASSERT_EQ(f.recovered.size(), 1U);
  EXPECT_NEAR(f.recovered[0].column_px, Frame::place(9, 0), 0.1);
  EXPECT_LT(f.recovered[0].sigma_px, 0.2F);
}

TEST(Weighing, ASurePlaceStaysWhereItIs) {
  Frame f;
  f.move(7, 5, 0.4F, 0.03F);
  const WeighingCounts counts = f.weigh();
  EXPECT_EQ(counts.moved, 0U);
  EXPECT_FLOAT_EQ(f.edge(7, 5).column_px, Frame::place(7, 5) + 0.4F);
}

TEST(Weighing, BesideAnotherSurfaceNothingPullsAPlaceThere) {
  Frame f;
  for (int line = 0; line < kLines; ++line) {
    for (int b = 6; b < kBoundaries; ++b) f.edge(line, b).column_px += 25;
    f.move(line, 5, 0, 0.15F);
  }
  f.weigh();
  for (int line = 4; line + 4 < kLines; ++line)
    EXPECT_NEAR(f.edge(line, 5).column_px, Frame::place(line, 5), 0.01) << line;
}

TEST(Weighing, WhereASurfaceEndsItTurnsAwaySoonerThanItsBendTells) {
  // Spacings of 8, 7.8 and 7.6 px are followed by one of 7.46 - 0.4.
  const Foretold turning = ends_on({123.4F, 115.8F, 108.F}, {0.02F, 0.02F, 0.02F});
  EXPECT_NEAR(turning.column_px, 123.4F + 7.46F - 0.4F, 1e-3F);
  EXPECT_NEAR(turning.unsure_px, 0.3F, 1e-6F);
  // The other way round, the same.
  const Foretold left = ends_on({-123.4F, -115.8F, -108.F}, {0.02F, 0.02F, 0.02F});
  EXPECT_NEAR(left.column_px, -turning.column_px, 1e-3F);
  // What noise explains is no bend, and what draws apart is anybody's guess.
  const Foretold noisy = ends_on({123.4F, 115.8F, 108.F}, {0.06F, 0.06F, 0.06F});
  EXPECT_NEAR(noisy.column_px, 123.4F + 7.46F, 1e-3F);
  EXPECT_EQ(noisy.unsure_px, 0);
  const Foretold apart = ends_on({123.8F, 115.8F, 108.F}, {0.02F, 0.02F, 0.02F});
  EXPECT_NEAR(apart.column_px, 123.8F + 8.14F, 1e-3F);
  EXPECT_NEAR(apart.unsure_px, 0.7F, 1e-6F);
}

TEST(Weighing, WhatStaysUnsureIsGivenUp) {
  Frame f;
  for (int line = 0; line < kLines; ++line)
    for (int b = 0; b < kBoundaries; ++b)
      if (line != 7 || b != 5) f.lose(line, b);
  f.edge(7, 5).sigma_px = 0.4F;
  EXPECT_EQ(f.weigh().rejected, 0U);
  f.edge(7, 5).sigma_px = 0.9F;
  f.recovered.push_back({15, 3, 60, 0.9F, 0});
  EXPECT_EQ(f.weigh().rejected, 2U);
  EXPECT_EQ(f.result.boundary[Frame::at(7, 5)], -1);
  EXPECT_TRUE(f.recovered.empty());
}

TEST(Weighing, WhereThingsMoveMoreSo) {
  Frame still, moving;
  for (int line = 0; line < kLines; ++line) {
    for (int b = 0; b < kBoundaries; ++b) {
      if (b == 5 && line == 7) continue;
      // The left of the picture, too far away to say anything of this place but that its surroundings move.
      if (b < 4 && line > 4 && line < 10) {
        moving.result.still[Frame::at(line, b)] = 0;
        continue;
      }
      still.lose(line, b);
      moving.lose(line, b);
    }
  }
  still.edge(7, 5).sigma_px = moving.edge(7, 5).sigma_px = 0.65F;
  EXPECT_EQ(still.weigh().rejected, 0U);
  EXPECT_EQ(moving.weigh().rejected, 1U);
}

TEST(Weighing, SoIsWhatNeighboursPullFar) {
  Frame alone, pulled;
  for (int line = 0; line < kLines; ++line) {
    for (int b = 0; b < kBoundaries; ++b) {
      if (b == 5 && (line == 7 || line == 8 || line == 9)) continue;
      alone.lose(line, b);
      pulled.lose(line, b);
    }
  }
  alone.move(7, 5, 0, 0.45F);
  pulled.move(7, 5, 1.6F, 0.45F);
  EXPECT_EQ(alone.weigh().rejected, 0U);
  EXPECT_EQ(pulled.weigh().rejected, 1U);
}

TEST(Persistence, WhatStandsStillIsThereThoughThisSlideDoesNotShowIt) {
  Persistence persistence;
  Frame before;
  EXPECT_EQ(before.carry(persistence), 0U);
  Frame now(0.2F);
  now.lose(7, kBoundaries - 1);
  ASSERT_EQ(now.carry(persistence), 1U);
  const RecoveredBoundary& carried = now.recovered.back();
  EXPECT_EQ(carried.line, 7);
  EXPECT_EQ(carried.boundary, kBoundaries - 1);
  EXPECT_NEAR(carried.column_px, Frame::place(7, kBoundaries - 1) + 0.2F, 1e-4);
  EXPECT_GT(carried.sigma_px, 0.05F);
  EXPECT_FLOAT_EQ(now.places.line(7)[kBoundaries - 1].column_px, carried.column_px);
}

TEST(Persistence, WhatWasCarriedIsNotCarriedAgain) {
  Persistence persistence;
  Frame before;
  before.carry(persistence);
  for (const std::size_t carried : {1U, 0U}) {
    Frame now;
    now.lose(7, 11);
    EXPECT_EQ(now.carry(persistence), carried);
  }
}

TEST(Persistence, WhereSomethingMovesNothingIsCarried) {
  Persistence persistence;
  Frame before;
  before.carry(persistence);
  Frame now;
  now.lose(7, 11);
  now.result.still[Frame::at(8, 10)] = 0;
  EXPECT_EQ(now.carry(persistence), 0U);
}

TEST(Persistence, NorWhereNeighboursWentUnlikeEachOtherOrFar) {
  for (const float px : {0.4F, 2.F}) {
    Persistence persistence;
    Frame before;
    before.carry(persistence);
    Frame now(px == 2 ? px : 0);
    now.lose(7, 11);
    if (px < 2) now.edge(8, 11).column_px += px;
    EXPECT_EQ(now.carry(persistence), 0U) << px;
  }
}

TEST(Persistence, NorWhereAnotherBoundaryIsNow) {
  Persistence persistence;
  Frame before;
  before.carry(persistence);
  Frame now;
  now.lose(7, 11);
  now.edge(7, 10).column_px = Frame::place(7, 11) - 1;  // out of what tells the motion, but in the way
  EXPECT_EQ(now.carry(persistence), 0U);
}

TEST(Persistence, NorWhatWasUnsureBefore) {
  Persistence persistence;
  Frame before;
  before.edge(7, 11).sigma_px = 0.3F;
  before.carry(persistence);
  Frame now;
  now.lose(7, 11);
  EXPECT_EQ(now.carry(persistence), 0U);
}

}  // namespace
}  // namespace relievo
