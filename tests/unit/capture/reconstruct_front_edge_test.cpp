// SPDX-License-Identifier: Apache-2.0
// Proves: the last boundary of a surface in front of another, which shows the other's colour on its far
// side, is given to the surface that it goes on from, whichever side the projector stands on.
#include "capture/reconstruct/front_edge.h"

#include <gtest/gtest.h>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

class FrontEdgeTest : public ::testing::Test {
 protected:
  static Rig rig_with_projector_at(double x_m) {
    Rig rig;
    rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    rig.projector_from_camera_translation = {-x_m, 0, 0};
    return rig;
  }
  const FrontEdges::Colours& shown() const { return sequence_.shown_colours(SlideOrder::kNewerIsFirst); }
  const FrontEdges::Colours& other() const { return sequence_.shown_colours(SlideOrder::kNewerIsSecond); }

  /// A boundary further on that, in one slide or the other, looks like `like` on its side of it (0: the
  /// left).
  int lookalike(int like, std::size_t side, bool in_shown, bool in_other) const {
    const auto l = static_cast<std::size_t>(like);
    for (std::size_t b = l + 3; b + 3 < shown().size(); ++b)
      if ((shown()[b][side] == shown()[l][side]) == in_shown &&
          (other()[b][side] == other()[l][side]) == in_other)
        return static_cast<int>(b);
    return -1;
  }

  struct Seen {
    float column_px;
    int boundary;
  };
  std::vector<int> corrected(const Rig& rig, const std::vector<Seen>& line) {
    EdgeImage edges;
    edges.lines = 1;
    edges.line_start = {0, static_cast<std::uint32_t>(line.size())};
    SequenceResult result;
    result.seen_px.assign(shown().size(), 0);
    for (const Seen& s : line) {
      Edge edge;
      edge.column_px = s.column_px;
      edges.edges.push_back(edge);
      result.boundary.push_back(static_cast<std::int16_t>(s.boundary));
      result.seen_px[static_cast<std::size_t>(s.boundary)] = s.column_px;
    }
    count_ = FrontEdges(rig).correct(edges, shown(), other(), pool_, result);
    for (std::size_t i = 0; i < line.size(); ++i)
      EXPECT_EQ(result.seen_px[static_cast<std::size_t>(result.boundary[i])], line[i].column_px);
    return {result.boundary.begin(), result.boundary.end()};
  }

  const SequenceDecoder sequence_{*make_pattern(6, 2, 3, 90)};
  WorkerPool pool_{1};
  std::size_t count_ = 0;
};

TEST_F(FrontEdgeTest, WhatGoesOnFromTheFrontIsItsOwn) {
  for (const bool in_shown : {true, false}) {
    const int k = lookalike(11, 0, in_shown, !in_shown);
    ASSERT_GT(k, 0);
    const auto got = corrected(rig_with_projector_at(0.2),
                               {{100, 8}, {108, 9}, {116, 10}, {124, k}, {136, k + 1}, {144, k + 2}});
    EXPECT_EQ(got, (std::vector<int>{8, 9, 10, 11, k + 1, k + 2}));
    EXPECT_EQ(count_, 1U);
  }
}

TEST_F(FrontEdgeTest, BehindASliverThereIsNoMoreOfTheFront) {
  const int k = lookalike(11, 0, true, false);
  const int next = lookalike(12, 0, true, false);
  ASSERT_GT(k, 0);
  ASSERT_GT(next, 0);
  const auto got =
      corrected(rig_with_projector_at(0.2), {{100, 8}, {108, 9}, {116, 10}, {124, k}, {132.5F, next}});
  EXPECT_EQ(got, (std::vector<int>{8, 9, 10, 11, next}));
}

TEST_F(FrontEdgeTest, WhatGoesOnToWhatIsBehindStays) {
  const int k = lookalike(11, 0, true, false);
  const std::vector<int> as_seen{8, 9, 10, k, k + 1, k + 2};
  const auto got = corrected(rig_with_projector_at(0.2),
                             {{100, 8}, {108, 9}, {116, 10}, {123.5F, k}, {131.5F, k + 1}, {139.5F, k + 2}});
  EXPECT_EQ(got, as_seen);
  EXPECT_EQ(count_, 0U);
}

TEST_F(FrontEdgeTest, WhatShowsAnotherColourThanTheFrontsStays) {
  const int k = lookalike(11, 0, false, false);
  ASSERT_GT(k, 0);
  const auto got = corrected(rig_with_projector_at(0.2),
                             {{100, 8}, {108, 9}, {116, 10}, {124, k}, {136, k + 1}, {144, k + 2}});
  EXPECT_EQ(got[3], k);
}

TEST_F(FrontEdgeTest, WithTheProjectorOnTheOtherSideTheFrontIsOnTheRight) {
  const int front = lookalike(11, 1, true, false);  // looks like 11 on its right, so 11 can be taken for it
  ASSERT_GT(front, 0);
  const std::vector<Seen> line{{100, 9},         {108, 10},        {120, 11},
                               {128, front + 1}, {136, front + 2}, {144, front + 3}};
  EXPECT_EQ(corrected(rig_with_projector_at(-0.2), line)[2], front);
  EXPECT_EQ(corrected(rig_with_projector_at(0.2), line)[2], 11);
}

}  // namespace
}  // namespace relievo
