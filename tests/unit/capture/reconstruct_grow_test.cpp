// SPDX-License-Identifier: Apache-2.0
// Proves: boundaries that two slides cannot tell are found in the slide's field alone, from the lines around,
// from the line itself and from what stood there before; and are not where the field, the order, or what is
// known of another surface speaks against them.
#include "capture/reconstruct/grow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "capture/reconstruct/moving_places.h"

namespace relievo {
namespace {

constexpr int kLines = 20;
constexpr int kBoundaries = 8;
constexpr int kWidth = 160;
constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};

/// Stripes 9 px wide under one slide, all boundaries decoded, in a scene that holds still.
struct Frame {
  std::vector<Primary> stripes{1, 2, 4, 3, 5, 6, 1, 4, 2};
  std::vector<std::array<Primary, 2>> colours;
  Image8 picture{kWidth, kLines, 3};
  EdgeImage edges;
  SequenceResult result;
  std::vector<RecoveredBoundary> recovered;
  WorkerPool pool{2};

  Frame() {
    for (std::size_t b = 0; b + 1 < stripes.size(); ++b) colours.push_back({stripes[b], stripes[b + 1]});
    edges.lines = kLines;
    edges.line_start.push_back(0);
    for (int line = 0; line < kLines; ++line) {
      for (int x = 0; x < kWidth; ++x) paint(line, x, stripe_at(x));
      for (int b = 0; b < kBoundaries; ++b) {
        Edge edge;
        edge.column_px = place(b);
        edges.edges.push_back(edge);
        result.boundary.push_back(static_cast<std::int16_t>(b));
        result.still.push_back(1);
        result.doubted.push_back(-1);
      }
      edges.line_start.push_back(static_cast<std::uint32_t>(edges.edges.size()));
    }
  }

  /// Between the pixels of the two stripes.
  static float place(int boundary) { return 39.5F + 9 * static_cast<float>(boundary); }
  Primary stripe_at(int x) const {
    const int stripe = static_cast<int>(std::floor((static_cast<float>(x) - place(0)) / 9)) + 1;
    return stripes[static_cast<std::size_t>(std::clamp(stripe, 0, kBoundaries))];
  }
  void paint(int line, int x, Primary colour) {
    for (int c = 0; c < 3; ++c)
      picture.row(line)[3 * x + c] = (colour >> c & 1) != 0 ? static_cast<std::uint8_t>(120 + 30 * c) : 10;
  }
  static std::size_t at(int line, int boundary) {
    return static_cast<std::size_t>(line * kBoundaries + boundary);
  }
  void lose(int line, int boundary) { result.boundary[at(line, boundary)] = -1; }
  void move(int line) {
    for (int b = 0; b < kBoundaries; ++b) result.still[at(line, b)] = 0;
  }
  std::size_t grow() {
    return Growth(kIdentity, kBoundaries, kLines)
        .grow({picture.view(), colours}, edges, pool, result, recovered);
  }
};

TEST(Growth, NothingIsAddedWhereNothingIsMissing) {
  EXPECT_EQ(Frame().grow(), 0U);
}

TEST(Growth, WhatIsMissingBetweenLinesIsFoundInTheSlidesFieldAlone) {
  for (int lost = 1; lost <= 6; ++lost) {
    Frame f;
    for (int line = 7; line < 10; ++line) f.lose(line, lost);
    ASSERT_EQ(f.grow(), 3U) << lost;
    for (const RecoveredBoundary& r : f.recovered) {
      EXPECT_EQ(r.boundary, lost);
      EXPECT_NEAR(r.column_px, Frame::place(lost), 0.05F);
      EXPECT_GT(r.sigma_px, 0);
    }
  }
}

TEST(Growth, TheFieldSaysWhereItIsMoreThanOneLineDoes) {
  const auto grown = [](float line_is_off_px) {
    Frame f;
    f.move(7);
    f.lose(7, kBoundaries - 1);
    for (int line = 8; line < kLines; ++line) f.lose(line, kBoundaries - 1);
    for (int line = 0; line < 7; ++line)
      f.edges.edges[Frame::at(line, kBoundaries - 1)].column_px += line_is_off_px;
    EXPECT_GE(f.grow(), 1U);
    return f.recovered.at(0);
  };
  const RecoveredBoundary agreed = grown(0);
  const RecoveredBoundary disagreed = grown(1);
  EXPECT_NEAR(disagreed.column_px, Frame::place(kBoundaries - 1), 0.15F);
  EXPECT_GT(disagreed.sigma_px, 1.8F * agreed.sigma_px);
}

TEST(Growth, WhatWasDoubtedComesBackWhereTheFieldAndALineBesideShowIt) {
  constexpr int kLast = kBoundaries - 1;
  const auto grown = [](bool line_above, Primary right) {
    Frame f;
    for (int line = 5; line < 10; ++line) f.move(line);
    for (int line = line_above ? 7 : 5; line < kLines; ++line)
      for (int b = 0; b < kBoundaries; ++b) f.lose(line, b);
    f.result.doubted[Frame::at(7, kLast)] = kLast;
    for (int x = static_cast<int>(Frame::place(kLast)) + 1; x < kWidth; ++x) f.paint(7, x, right);
    f.grow();
    return std::count_if(f.recovered.begin(), f.recovered.end(),
                         [](const RecoveredBoundary& r) { return r.line == 7 && r.boundary == kLast; });
  };
  EXPECT_EQ(grown(true, 2), 1);
  EXPECT_EQ(grown(false, 2), 0) << "alone";
  EXPECT_EQ(grown(true, 5), 0) << "of another colour";
}

TEST(Growth, WhereMuchMovesTheFieldSaysWhatIsNotThere) {
  const auto is_kept = [](bool others_move) {
    Frame f;
    f.result.still[Frame::at(7, 3)] = 0;
    if (others_move) f.move(7);
    for (int x = 55; x < 80; ++x) f.paint(7, x, 6);  // of what is in front by now
    MovingPlaces moving;
    moving.find(kWidth, f.result, f.edges);
    SlideFieldView view{.field = f.picture.view(), .colours = f.colours, .moving = &moving};
    Growth(kIdentity, kBoundaries, kLines).grow(view, f.edges, f.pool, f.result, f.recovered);
    return f.result.boundary[Frame::at(7, 3)] == 3;
  };
  EXPECT_FALSE(is_kept(true));
  EXPECT_TRUE(is_kept(false)) << "alone it may be a track that was lost";
}

TEST(Growth, FarFromWhereItIsExpectedItIsAnothers) {
  Frame f;
  f.move(7);
  f.lose(7, kBoundaries - 1);
  for (int line = 8; line < kLines; ++line) f.lose(line, kBoundaries - 1);
  for (int line = 0; line < 7; ++line) f.edges.edges[Frame::at(line, kBoundaries - 1)].column_px += 2.5F;
  EXPECT_EQ(f.grow(), 0U);
}

TEST(Growth, WhereTheFieldShowsOtherColoursThereIsNone) {
  Frame f;
  f.lose(7, 3);
  for (int x = 60; x < 75; ++x) f.paint(7, x, x < 67 ? 6 : 1);  // the stripes there are 3 and 5
  EXPECT_EQ(f.grow(), 0U);
}

TEST(Growth, WhereColoursFallInsteadOfRisingNothingOutsideThePictureIsRead) {
  Frame f;
  f.lose(7, 3);  // green ends there and blue begins
  for (int x = 45; x < 90; ++x) {
    f.picture.row(7)[3 * x + 1] = static_cast<std::uint8_t>(40 + 3 * (x - 45));
    f.picture.row(7)[3 * x + 2] = static_cast<std::uint8_t>(200 - 3 * (x - 45));
  }
  EXPECT_EQ(f.grow(), 0U);
}

TEST(Growth, WhereTheFieldShowsNoLightThereIsNone) {
  Frame f;
  f.lose(7, 3);
  for (int x = 55; x < 80; ++x) f.paint(7, x, 0);
  EXPECT_EQ(f.grow(), 0U);
}

TEST(Growth, ASurfacesEndGoesOnWhereItMovesOnly) {
  for (const bool moves : {false, true}) {
    Frame f;
    for (int line = 12; line < kLines; ++line) f.lose(line, kBoundaries - 1);
    for (int line = 11; moves && line < 16; ++line) f.move(line);
    EXPECT_EQ(f.grow(), moves ? 4U : 0U);
  }
}

/// Two frames, in the second of which the last boundary is lost on the lines from 12 on, where something
/// moves.
class AfterAnother : public ::testing::Test {
 protected:
  AfterAnother() {
    for (int line = 12; line < kLines; ++line) {
      second_.move(line);
      second_.lose(line, kLost);
    }
  }
  std::size_t grow() {
    for (int k = 0; k < 2; ++k)  // under both slides
      growth_.grow({first_.picture.view(), first_.colours, nullptr, k}, first_.edges, first_.pool,
                   first_.result, first_.recovered);
    return growth_.grow({second_.picture.view(), second_.colours}, second_.edges, second_.pool,
                        second_.result, second_.recovered);
  }
  void paint_second(int from, int to, Primary colour) {
    for (int line = 12; line < kLines; ++line)
      for (int x = from; x < to; ++x) second_.paint(line, x, colour);
  }

  static constexpr int kLost = kBoundaries - 1;
  static constexpr int kColumn = 102;  // of the pixel left of it
  Frame first_, second_;
  Growth growth_{kIdentity, kBoundaries, kLines};
};

TEST_F(AfterAnother, WhatLooksAsBeforeIsBackWhereItWas) {
  EXPECT_EQ(grow(), 8U);
  for (const RecoveredBoundary& r : second_.recovered) {
    EXPECT_EQ(r.boundary, kLost);
    EXPECT_EQ(r.column_px, Frame::place(kLost));
    EXPECT_LT(r.sigma_px, 0.2F);
  }
}

TEST_F(AfterAnother, WhatLooksOtherwiseIsCovered) {
  paint_second(kColumn + 1, kColumn + 6, 5);
  EXPECT_EQ(grow(), 0U);
}

TEST_F(AfterAnother, AnEdgeAtItsPlaceIsItsOwn) {
  for (int line = 12; line < kLines; ++line) second_.result.boundary[Frame::at(line, kLost)] = 2;
  for (int line = 12; line < kLines; ++line) second_.lose(line, 2);
  for (int line = 12; line < kLines; ++line)
    for (int x = 50; x < 66; ++x) second_.paint(line, x, 7);  // and what was there is not
  EXPECT_EQ(grow(), 8U);
  for (int line = 12; line < kLines; ++line)
    EXPECT_EQ(second_.result.boundary[Frame::at(line, kLost)], kLost);
  EXPECT_TRUE(second_.recovered.empty());
}

TEST_F(AfterAnother, WhatWasOfUnknownPlaceIsNotRemembered) {
  for (Edge& e : first_.edges.edges) e.sigma_px = 0.5F;
  for (int line = 12; line < kLines; ++line)
    for (int b = 0; b < kBoundaries - 1; ++b) second_.lose(line, b);
  EXPECT_EQ(grow(), 0U);
}

TEST(Growth, BesideWhatStandsStillALineGoesOnWhereMuchMovesOnly) {
  constexpr int kLost = kBoundaries - 1;
  const auto grown = [](bool others_move) {
    Frame first, second;
    for (int line = 0; line < kLines; ++line) first.lose(line, kLost), second.lose(line, kLost);
    SequenceResult as_moves = second.result;
    if (others_move) std::fill(as_moves.still.begin(), as_moves.still.end(), std::uint8_t{0});
    MovingPlaces moving;
    moving.find(kWidth, as_moves, second.edges);
    Growth growth(kIdentity, kBoundaries, kLines);
    for (int k = 0; k < 2; ++k)  // under both slides
      growth.grow({first.picture.view(), first.colours, nullptr, k}, first.edges, first.pool, first.result,
                  first.recovered);
    return growth.grow({.field = second.picture.view(), .colours = second.colours, .moving = &moving},
                       second.edges, second.pool, second.result, second.recovered);
  };
  EXPECT_EQ(grown(true), static_cast<std::size_t>(kLines));
  EXPECT_EQ(grown(false), 0U);
}

TEST(Growth, BesideAnOutlineTheLineGoesOn) {
  Frame f;
  for (int line = 0; line < kLines; ++line) f.move(line), f.lose(line, 6), f.lose(line, 7);
  EXPECT_EQ(f.grow(), static_cast<std::size_t>(2 * kLines));
  for (const RecoveredBoundary& r : f.recovered)
    EXPECT_NEAR(r.column_px, Frame::place(r.boundary), 0.1F) << r.boundary;
}

TEST(Growth, AtASurfacesEndWhatIsNextToABoundaryIsEnough) {
  for (const bool narrow : {false, true}) {
    Frame f;
    for (int line = 0; line < kLines; ++line) {
      f.move(line);
      f.lose(line, 7);
      for (int x = 103 + (narrow ? 0 : 2); x < 112; ++x) f.paint(line, x, 0);  // boundary 7 is at 102.5
    }
    EXPECT_EQ(f.grow(), narrow ? 0U : static_cast<std::size_t>(kLines));
  }
}

TEST(Growth, ABoundaryThatWouldBreakTheOrderIsNone) {
  Frame f;
  for (int line = 0; line < kLines; ++line) {
    f.lose(line, 3);
    if (line != 7) continue;
    f.result.boundary[Frame::at(line, 3)] = 6;  // as 6 and 3 swapped
    f.lose(line, 6);
  }
  f.result.boundary[Frame::at(6, 3)] = 3;
  f.result.boundary[Frame::at(8, 3)] = 3;
  f.grow();
  for (const RecoveredBoundary& r : f.recovered) EXPECT_FALSE(r.line == 7 && r.boundary == 3);
}

TEST(Growth, WhereAllMovesWhatLinesEncloseIsFoundAndLinesGoOn) {
  Frame f;
  for (int line = 0; line < kLines; ++line) f.move(line);
  f.lose(7, 3);
  for (int line = 12; line < kLines; ++line) f.lose(line, kBoundaries - 1);
  ASSERT_EQ(f.grow(), 9U);
  EXPECT_EQ(f.recovered.front().boundary, 3);
}

TEST(Growth, AtThePicturesEdgesAndOnLinesThatTheFieldLacksNothingIsRead) {
  Frame f;
  for (int line = 0; line < kLines; ++line) {
    for (int b = 0; b < kBoundaries; ++b)
      f.edges.edges[Frame::at(line, b)].column_px =
          static_cast<float>(b) * static_cast<float>(kWidth - 1) / 7;
    f.move(line);
    if (line % 3 != 0) f.lose(line, 0), f.lose(line, kBoundaries - 1);
  }
  f.picture = Image8(kWidth, kLines - 1, 3);
  EXPECT_EQ(f.grow(), 0U);
}

}  // namespace
}  // namespace relievo
