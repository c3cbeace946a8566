// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/readmit.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/unit/capture/decoded_frame.h"

namespace relievo {
namespace {

constexpr int kLines = 20;
constexpr int kBoundaries = 12;

/// Boundaries 8 px apart that lean by 0.3 px a line, all decoded, at the edge of a contrasty scene that holds
/// still.
struct Frame : DecodedFrame {
  Frame() : DecodedFrame(decoded_frame(kLines, kBoundaries, {.sigma_px = 0.1F, .contrast = 0.4F}, place)) {}

  static float place(int line, int boundary) {
    return 30 + 8 * static_cast<float>(boundary) + 0.3F * static_cast<float>(line);
  }
  static std::size_t at(int line, int boundary) {
    return static_cast<std::size_t>(line * kBoundaries + boundary);
  }
  Edge& edge(int line, int boundary) { return edges.edges[at(line, boundary)]; }
  void doubt(int line, int boundary) {
    result.boundary[at(line, boundary)] = -1;
    result.doubted[at(line, boundary)] = static_cast<std::int16_t>(boundary);
  }

  std::size_t readmit(const std::vector<RecoveredBoundary>& recovered = {}) {
    return Readmission(kBoundaries, kLines).readmit(recovered, result, edges);
  }
  bool decoded(int line, int boundary) const { return result.boundary[at(line, boundary)] == boundary; }
};

TEST(Readmission, ADoubtedBoundaryThatLinesBesideItConfirmIsTakenBack) {
  Frame f;
  f.doubt(7, 0);
  f.edge(7, 0).column_px += 0.3F;
  EXPECT_EQ(f.readmit(), 1U);
  EXPECT_TRUE(f.decoded(7, 0));
  EXPECT_LT(f.edge(7, 0).column_px, Frame::place(7, 0) + 0.29F) << "it moves towards where it is predicted";
  EXPECT_GT(f.edge(7, 0).column_px, Frame::place(7, 0));
}

TEST(Readmission, OffItsLineItStaysGivenUp) {
  Frame f;
  f.doubt(7, 0);
  f.edge(7, 0).column_px += 1.5F;
  EXPECT_EQ(f.readmit(), 0U);
  EXPECT_FALSE(f.decoded(7, 0));
}

TEST(Readmission, LinesOfAnotherSurfaceTellNothing) {
  Frame f;
  f.doubt(7, 0);
  f.edge(7, 0).above_differs = f.edge(7, 0).below_differs = true;
  EXPECT_EQ(f.readmit(), 0U);
}

TEST(Readmission, TwoNeighboursOnTheLineConfirmItToo) {
  Frame f;
  f.doubt(7, 5);
  f.edge(7, 5).above_differs = f.edge(7, 5).below_differs = true;
  EXPECT_EQ(f.readmit(), 1U);
  Frame uneven;
  uneven.doubt(7, 5);
  uneven.edge(7, 5).above_differs = uneven.edge(7, 5).below_differs = true;
  uneven.edge(7, 5).column_px += 3;
  EXPECT_EQ(uneven.readmit(), 0U) << "stripes of one surface are as wide as those beside them";
}

TEST(Readmission, WhatIsTakenBackConfirmsOthersForSomeLinesWhereTheSceneHoldsStill) {
  Frame f;
  for (int line = 0; line < 12; ++line) f.doubt(line, 0);
  EXPECT_EQ(f.readmit(), 4U);
  for (int line = 0; line < 12; ++line) EXPECT_EQ(f.decoded(line, 0), line >= 8) << line;
}

TEST(Readmission, AndForAllWhereItMoves) {
  Frame f;
  for (int line = 0; line < 12; ++line) {
    f.doubt(line, 0);
    f.result.still[Frame::at(line, 0)] = 0;
  }
  EXPECT_EQ(f.readmit(), 12U);
}

TEST(Readmission, ButNotWhereAllMoves) {
  Frame f;
  f.result.still.assign(f.result.still.size(), 0);
  f.doubt(7, 0);
  EXPECT_EQ(f.readmit(), 0U);
}

TEST(Readmission, WhereNothingSpoilsABoundaryWhatIsAgainstItIsBelieved) {
  Frame f;
  f.doubt(7, 0);
  f.edge(7, 0).contrast = 0.1F;
  EXPECT_EQ(f.readmit(), 0U);
  f.result.still[Frame::at(7, 0)] = 0;
  EXPECT_EQ(f.readmit(), 1U) << "what moves is against it anyway";
}

TEST(Readmission, ABoundaryThatIsThereAlreadyIsNotTakenBackTwice) {
  Frame f;
  f.doubt(7, 0);
  EXPECT_EQ(f.readmit({{7, 0, Frame::place(7, 0), 0.1F, 0}}), 0U);
  EXPECT_FALSE(f.decoded(7, 0));
}

TEST(Readmission, NeitherIsOneThatIsTooUncertain) {
  Frame f;
  f.doubt(7, 0);
  f.edge(7, 0).sigma_px = 0.3F;
  f.doubt(12, 0);
  f.edge(12, 0).sigma_px = 0.3F;
  f.result.still[Frame::at(12, 0)] = 0;
  f.doubt(15, 0);
  f.edge(15, 0).sigma_px = 0.4F;
  EXPECT_EQ(f.readmit(), 1U);
  EXPECT_TRUE(f.decoded(7, 0));
  EXPECT_GE(f.edge(7, 0).sigma_px, 0.1F);
}

}  // namespace
}  // namespace relievo
