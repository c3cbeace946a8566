// SPDX-License-Identifier: Apache-2.0
// What is done once all boundaries of a frame are found: carried from the frame before, weighed, given up.
#include "capture/reconstruct/weigh.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/doubtful.h"
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
  std::size_t weigh() {
    fill();
    return relievo::weigh(places, pool, result, edges, recovered);
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
  EXPECT_EQ(f.weigh(), 2U);
  EXPECT_NEAR(f.edge(7, 5).column_px, Frame::place(7, 5), 0.05);
  EXPECT_LT(f.edge(7, 5).sigma_px, 0.1F);
  ASSERT_EQ(f.recovered.size(), 1U);
  EXPECT_NEAR(f.recovered[0].column_px, Frame::place(9, 0), 0.1);
  EXPECT_LT(f.recovered[0].sigma_px, 0.2F);
}

TEST(Weighing, ASurePlaceStaysWhereItIs) {
  Frame f;
  f.move(7, 5, 0.4F, 0.03F);
  EXPECT_EQ(f.weigh(), 0U);
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

/// A grid of the frame's places, as far as they are known, after what is doubtful was given up. How many
/// were.
std::size_t doubtful(Frame& f, DecodedGrid& grid) {
  grid.reset(kBoundaries, kLines);
  for (int line = 0; line < kLines; ++line) {
    grid.start_line(line);
    for (int b = 0; b < kBoundaries; ++b) {
      const Edge& e = f.edge(line, b);
      if (f.result.boundary[Frame::at(line, b)] >= 0) grid.put(line, b, e.column_px, e.sigma_px, 1);
    }
  }
  return give_up_doubtful(f.moving(), kWidth_px, f.pool, grid);
}
bool known(const DecodedGrid& grid, int line, int boundary) {
  return grid.column_px(line)[boundary] == grid.column_px(line)[boundary];
}

TEST(Doubtful, WhatIsOutOfLineWithLittleToTellItsPlace) {
  DecodedGrid grid;
  Frame f;
  EXPECT_EQ(doubtful(f, grid), 0U);
  f.move(7, 5, 0, 0.5F);  // in line with those around
  EXPECT_EQ(doubtful(f, grid), 0U);
  f.move(7, 5, 0.3F, 0.5F);
  f.move(13, 3, 0.3F, 0.2F);  // as far out of line, but surer
  EXPECT_EQ(doubtful(f, grid), 1U);
  EXPECT_FALSE(known(grid, 7, 5));
  EXPECT_TRUE(known(grid, 13, 3));
}

// To where its motion between the fields, or its neighbours', has carried it: a stream has no place for it.
TEST(Doubtful, WhatIsBesideThePicture) {
  DecodedGrid grid;
  Frame f;
  for (int line = 0; line < kLines; ++line) {
    f.move(line, 0, -Frame::place(line, 0), 0.02F);
    f.move(line, kBoundaries - 1, static_cast<float>(kWidth_px - 1) - Frame::place(line, kBoundaries - 1),
           0.02F);
  }
  EXPECT_EQ(doubtful(f, grid), 0U) << "the first and the last column";
  f.move(7, 0, -0.1F, 0.02F);
  f.move(13, kBoundaries - 1, 0.1F, 0.3F);
  EXPECT_EQ(doubtful(f, grid), 2U);
  EXPECT_FALSE(known(grid, 7, 0));
  EXPECT_FALSE(known(grid, 13, kBoundaries - 1));
}

TEST(Doubtful, WhereThingsMoveSooner) {
  DecodedGrid grid;
  for (const bool moves : {false, true}) {
    Frame f;
    for (int line = 5; moves && line < 10; ++line)
      for (int b = 3; b < 8; ++b) f.result.still[Frame::at(line, b)] = 0;
    f.move(7, 5, 0.3F, 0.28F);
    EXPECT_EQ(doubtful(f, grid), moves ? 1U : 0U);
  }
}

TEST(Doubtful, BesideANarrowStripeSooner) {
  DecodedGrid grid;
  for (const auto& [stripe_px, given_up] : {std::pair{5.F, 1U}, {8.F, 0U}}) {
    Frame f;
    for (int line = 0; line < kLines; ++line) f.edge(line, kBoundaries - 1).column_px += stripe_px - 8;
    f.move(7, kBoundaries - 1, 0.15F, 0.3F);
    EXPECT_EQ(doubtful(f, grid), given_up) << stripe_px;
  }
}

TEST(Doubtful, WhereAllStripesAreNarrowNoneIs) {
  DecodedGrid grid;
  Frame f;
  for (int line = 0; line < kLines; ++line)
    for (int b = 0; b < kBoundaries; ++b) f.edge(line, b).column_px -= 5 * static_cast<float>(b);
  f.move(7, 5, 0.15F, 0.2F);
  f.move(13, 3, 0.3F, 0.6F);
  EXPECT_EQ(doubtful(f, grid), 1U);
  EXPECT_TRUE(known(grid, 7, 5));
}

TEST(Doubtful, WhatIsInFrontIsNoNarrowStripe) {
  DecodedGrid grid;
  Frame f;
  for (int line = 0; line < kLines; ++line) f.edge(line, kBoundaries - 1).column_px -= 38;
  f.move(7, kBoundaries - 1, 0.15F, 0.2F);
  EXPECT_EQ(doubtful(f, grid), 0U);
}

TEST(Doubtful, WhereNothingIsAroundItsStandardDeviationTells) {
  DecodedGrid grid;
  for (const auto& [sigma_px, given_up] : {std::pair{0.1F, 0U}, {0.3F, 1U}}) {
    Frame f;
    for (int line = 0; line < kLines; ++line)
      for (int b = 0; b < kBoundaries; ++b)
        if (line != 7 || b != 5) f.lose(line, b);
    f.edge(7, 5).sigma_px = sigma_px;
    EXPECT_EQ(doubtful(f, grid), given_up) << sigma_px;
  }
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
