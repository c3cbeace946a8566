// SPDX-License-Identifier: Apache-2.0
// Proves: a boundary that a line shows twice is told by its colours and by what goes on to it, and the
// surface behind is whole beside the one in front of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/second_places.h"
#include "capture/reconstruct/surface_builder.h"
#include "capture/reconstruct/triangulate.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using test::striped_scene;
using test::StripedScene;

/// Lines on which `kBoundary` is at `kColumn_px`, but for one, which has it elsewhere and there an edge.
class SecondPlacesTest : public ::testing::Test {
 protected:
  SecondPlacesTest() {
    other_.width = kWidth;
    other_.lines = kLines;
    const auto b = static_cast<std::size_t>(kBoundary);
    const auto [left, right] = sequence_.shown_colours(SlideOrder::kNewerIsFirst)[b];
    const auto [other_left, other_right] = sequence_.shown_colours(SlideOrder::kNewerIsSecond)[b];
    for (int line = 0; line < kLines; ++line)
      for (int channel = 0; channel < 3; ++channel)
        for (int x = 0; x < kWidth; ++x) {
          const Primary colour = static_cast<float>(x) < kColumn_px ? other_left : other_right;
          other_.values.push_back((colour >> channel & 1) != 0 ? 50.F : -50.F);
        }
    other_.noise = 1;
    context_.other = &other_;
    first_.reset(pattern_.boundaries(), kLines);
    for (int line = 0; line < kLines; ++line)
      first_.put(line, kBoundary, line == kLine ? 40 : kColumn_px, 0.05F, 10);
    edge_.column_px = kColumn_px + 0.5F;
    edge_.sigma_px = 0.03F;
    edge_.left_reach_px = edge_.right_reach_px = 4;
    for (std::size_t channel = 0; channel < 3; ++channel) {
      edge_.left[channel] = (left >> channel & 1) != 0 ? 1.F : -1.F;
      edge_.right[channel] = (right >> channel & 1) != 0 ? 1.F : -1.F;
    }
    result_.boundary = {-1};
    result_.still = {1};
  }

  std::size_t found() {
    EdgeImage edges;
    edges.lines = kLines;
    for (int line = 0; line <= kLines; ++line) edges.line_start.push_back(line > kLine);
    edges.edges = {edge_};
    MovingPlaces moving;
    moving.find(kWidth, SequenceResult{.boundary = {-1}, .doubted = {-1}, .still = {1}}, edges);
    places_.clear();
    return places_.find({edges, result_, sequence_, context_, moving, first_}, pool_);
  }

  static constexpr int kWidth = 200, kLines = 9, kLine = 4, kBoundary = 10;
  static constexpr float kColumn_px = 100;
  const Pattern pattern_ = *make_pattern(6, 2, 3, 90);
  const SequenceDecoder sequence_{pattern_};
  DifferenceImage other_;
  SequenceContext context_{.order = SlideOrder::kNewerIsFirst};
  DecodedGrid first_;
  Edge edge_;
  SequenceResult result_;
  SecondPlaces places_;
  WorkerPool pool_{2};
};

TEST_F(SecondPlacesTest, AnEdgeWhereTheBoundaryGoesOnIsItsSecondPlace) {
  ASSERT_EQ(found(), 1U);
  const SecondPlace& p = places_.found()[0];
  EXPECT_EQ(p.boundary, kBoundary);
  EXPECT_EQ(p.line, kLine);
  EXPECT_NEAR(p.column_px, kColumn_px + 0.15F, 1e-4F);  // most of the way to where its neighbours are
  EXPECT_NEAR(p.sigma_px, std::hypot(0.03F, 0.35F), 1e-4F);
  places_.clear();
  EXPECT_TRUE(places_.found().empty());
}

TEST_F(SecondPlacesTest, NothingIsWhereNothingGoesOn) {
  edge_.column_px = kColumn_px + 1.2F;
  EXPECT_EQ(found(), 0U);
}

TEST_F(SecondPlacesTest, BoundariesBesideItOnTheLineConfirmIt) {
  for (int line = 0; line < kLines; ++line) first_.start_line(line);
  first_.put(kLine, kBoundary, 40, 0.05F, 10);
  EXPECT_EQ(found(), 0U);
  first_.put(kLine, kBoundary - 1, kColumn_px - 8, 0.05F, 10);
  first_.put(kLine, kBoundary - 2, kColumn_px - 16, 0.05F, 10);
  EXPECT_EQ(found(), 1U);
}

TEST_F(SecondPlacesTest, WhatIsOnlyOnceOnTheLineIsLeftToOthers) {
  first_.start_line(kLine);
  EXPECT_EQ(found(), 0U);
  first_.put(kLine, kBoundary, kColumn_px + 1.5F, 0.05F, 10);  // its own edge, blurred
  EXPECT_EQ(found(), 0U);
}

TEST_F(SecondPlacesTest, WhatIsABoundaryOrMovesOrIsUnsureIsNone) {
  result_.boundary = {12};
  EXPECT_EQ(found(), 0U);
  result_.boundary = {-1};
  result_.still = {0};
  EXPECT_EQ(found(), 0U);
  result_.still = {1};
  edge_.sigma_px = 0.2F;
  EXPECT_EQ(found(), 0U);
  edge_.sigma_px = 0.03F;
  edge_.at_step = true;
  EXPECT_EQ(found(), 0U);
}

TEST_F(SecondPlacesTest, BothSlidesMustShowItsColours) {
  std::ranges::transform(other_.values, other_.values.begin(), [](float v) { return -v; });
  EXPECT_EQ(found(), 0U);
  std::ranges::transform(other_.values, other_.values.begin(), [](float v) { return -v; });
  std::swap(edge_.left, edge_.right);
  EXPECT_EQ(found(), 0U);
}

TEST(SecondHalfWay, IsBetweenWhatBothFramesHaveOfOneSurface) {
  const std::vector<SecondPlace> before{
      {3, 1, 20, 0.1F}, {7, 1, 60, 0.1F}, {2, 4, 10, 0.1F}, {5, 6, 40, 0.1F}};
  const std::vector<SecondPlace> now{
      {3, 1, 20.5F, 0.2F}, {8, 1, 70, 0.2F}, {2, 4, 60, 0.2F}, {5, 6, 40, 0.2F}};
  std::vector<SecondPlace> out{{1, 1, 1, 1}};
  second_half_way(before, now, out);
  ASSERT_EQ(out.size(), 2U);
  EXPECT_EQ(std::pair(out[0].line, out[0].boundary), (std::pair<std::uint16_t, std::uint16_t>(1, 3)));
  EXPECT_FLOAT_EQ(out[0].column_px, 20.25F);
  EXPECT_EQ(std::pair(out[1].line, out[1].boundary), (std::pair<std::uint16_t, std::uint16_t>(6, 5)));
  second_half_way({}, now, out);
  EXPECT_TRUE(out.empty());
}

TEST_F(SecondPlacesTest, OfOneSlideItsOwnColoursTell) {
  context_.other = nullptr;
  EXPECT_EQ(found(), 1U);
  std::swap(edge_.left, edge_.right);
  EXPECT_EQ(found(), 0U);
}

/// A plane, before which another one hangs that takes some of its boundaries on some lines.
class SecondSurfaceTest : public ::testing::Test {
 protected:
  static constexpr int kLines = 60, kTop = 20, kBottom = 40, kLeft = 5, kRight = 9;
  static bool in_front(int line, int boundary) {
    return line >= kTop && line < kBottom && boundary >= kLeft && boundary < kRight;
  }

  /// `hides`: the front is there; `twice`: what it takes of the plane is seen beside it.
  Surface build(bool hides, bool twice) {
    const Triangulator triangulator(plane_.rig, plane_.pattern, kLines, 2);
    StripedScene front = plane_;
    front.depth_m = 0.7;
    DecodedGrid grid;
    grid.reset(plane_.pattern.boundaries(), kLines);
    std::vector<SecondPlace> second = more_;
    for (int line = 0; line < kLines; ++line) {
      for (int b = 0; b < plane_.pattern.boundaries(); ++b) {
        const auto column = static_cast<float>(plane_.camera_column(b));
        if (!(column > 2 && column < 157)) continue;
        const bool hidden = hides && in_front(line, b);
        grid.put(line, b, hidden ? static_cast<float>(front.camera_column(b)) : column, 0.05F, 10);
        if (hidden && twice)
          second.push_back({static_cast<std::uint16_t>(b), static_cast<std::uint16_t>(line), column, 0.05F});
      }
      triangulator.place_line(line, grid);
    }
    SurfaceBuilder builder(plane_.rig, 2, {});
    WorkerPool pool(1);
    Surface out;
    counts_ = {};
    builder.build(grid, second, triangulator, pool, out, counts_);
    return out;
  }

  const StripedScene plane_ = striped_scene();
  std::vector<SecondPlace> more_;
  FilterCounts counts_;
};

TEST_F(SecondSurfaceTest, WhatIsBehindIsWhole) {
  const Surface whole = build(false, false), holed = build(true, false), twice = build(true, true);
  constexpr std::size_t kFront = (kBottom - kTop) * (kRight - kLeft);
  constexpr std::size_t kFrontTriangles = 2UL * (kBottom - kTop - 1) * (kRight - kLeft - 1);
  ASSERT_EQ(holed.positions.size(), whole.positions.size());
  EXPECT_EQ(twice.positions.size(), whole.positions.size() + kFront);
  EXPECT_EQ(twice.triangles.size(), whole.triangles.size() + kFrontTriangles);
  EXPECT_EQ(counts_.small_component, 0U);
  for (const std::size_t size : {twice.normals.size(), twice.texture_coordinates.size(), twice.grid.size(),
                                 twice.sigmas_m.size(), twice.interpolated.size()})
    EXPECT_EQ(size, twice.positions.size());
  // First what was there without, then what is there twice.
  EXPECT_TRUE(std::equal(holed.positions.begin(), holed.positions.end(), twice.positions.begin()));
  EXPECT_TRUE(std::equal(holed.triangles.begin(), holed.triangles.end(), twice.triangles.begin()));
  for (std::size_t v = holed.positions.size(); v < twice.positions.size(); ++v) {
    const GridPoint& at = twice.grid[v];
    ASSERT_TRUE(at.line >= kLines && in_front(at.line - kLines, at.boundary));
    // The same vertex of the whole plane.
    const auto same = std::ranges::find_if(whole.grid, [&](const GridPoint& p) {
      return p.line == at.line - kLines && p.boundary == at.boundary;
    });
    const auto w = static_cast<std::size_t>(same - whole.grid.begin());
    ASSERT_LT(w, whole.grid.size());
    EXPECT_EQ(twice.positions[v], whole.positions[w]);
    EXPECT_EQ(twice.texture_coordinates[v], whole.texture_coordinates[w]);
    EXPECT_NEAR(twice.sigmas_m[v], whole.sigmas_m[w], 1e-3F * whole.sigmas_m[w]);
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(twice.normals[v][axis], whole.normals[w][axis], 1e-3F);
  }
  for (std::size_t t = holed.triangles.size(); t < twice.triangles.size(); ++t) {
    const auto [a, b, c] = twice.triangles[t];
    EXPECT_GE(std::max({a, b, c}), holed.positions.size());
  }
}

TEST_F(SecondSurfaceTest, APlaceThatNothingGoesOnToIsLeftOut) {
  const Surface without = build(true, false);
  more_ = {{7, 5, static_cast<float>(plane_.camera_column(7)) + 20, 0.05F}};
  const Surface with = build(true, false);
  EXPECT_EQ(with.positions, without.positions);
  EXPECT_EQ(with.triangles, without.triangles);
  EXPECT_EQ(with.interpolated.size(), with.positions.size());
  EXPECT_EQ(counts_.small_component, 1U);
}

}  // namespace
}  // namespace relievo
