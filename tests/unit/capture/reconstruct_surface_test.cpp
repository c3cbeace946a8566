// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <utility>

#include "tests/support/make_decoded.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

using test::decoded_grid;
using test::GridVertex;

/// A vertex of a wall at z(boundary, line), one centimetre a step across the view.
GridVertex vertex(int boundary, int line, float z = 1, float slope = 10) {
  return {{static_cast<std::uint16_t>(boundary), static_cast<std::uint16_t>(line),
           8.F * static_cast<float>(boundary)},
          {0.01F * static_cast<float>(boundary) * z, 0.01F * static_cast<float>(line) * z, z},
          slope};
}

std::vector<GridVertex> grid(int boundaries, int lines, const std::function<float(int, int)>& z) {
  std::vector<GridVertex> out;
  for (int l = 0; l < lines; ++l)
    for (int b = 0; b < boundaries; ++b) out.push_back(vertex(b, l, z(b, l)));
  return out;
}
std::vector<GridVertex> wall(int boundaries, int lines) {
  return grid(boundaries, lines, [](int, int) { return 1.F; });
}

Surface build(const std::vector<GridVertex>& vertices, int boundaries, int lines,
              const SurfaceOptions& options = {.least_component = 1}) {
  SurfaceScratch scratch;
  Surface out;
  build_surface(decoded_grid(vertices, boundaries, lines), options, scratch, out);
  return out;
}

std::array<float, 3> normal_of(const Surface& s, const Triangle& t) {
  const auto& a = s.positions[t[0]];
  const auto& b = s.positions[t[1]];
  const auto& c = s.positions[t[2]];
  const std::array<float, 3> u{b[0] - a[0], b[1] - a[1], b[2] - a[2]},
      v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

/// What holds of every surface.
void expect_sound(const Surface& s) {
  ASSERT_EQ(s.normals.size(), s.positions.size());
  ASSERT_EQ(s.grid.size(), s.positions.size());
  for (std::size_t i = 1; i < s.grid.size(); ++i) {
    ASSERT_LT(std::pair(s.grid[i - 1].line, s.grid[i - 1].boundary),
              std::pair(s.grid[i].line, s.grid[i].boundary));
  }
  for (const Triangle& t : s.triangles) {
    for (const std::uint32_t v : t) ASSERT_LT(v, s.positions.size());
    const auto n = normal_of(s, t);
    const auto& p = s.positions[t[0]];
    EXPECT_LT(n[0] * p[0] + n[1] * p[1] + n[2] * p[2], 0) << "a triangle turns its back on the camera";
  }
  for (std::size_t i = 0; i < s.normals.size(); ++i) {
    const auto& n = s.normals[i];
    EXPECT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 1e-5);
  }
}

bool same(const Surface& a, const Surface& b) {
  if (a.grid.size() != b.grid.size()) return false;
  for (std::size_t i = 0; i < a.grid.size(); ++i) {
    if (a.grid[i].boundary != b.grid[i].boundary || a.grid[i].line != b.grid[i].line ||
        a.grid[i].column_px != b.grid[i].column_px)
      return false;
  }
  return a.positions == b.positions && a.normals == b.normals && a.triangles == b.triangles;
}

TEST(Surface, AWallIsConnectedCellByCell) {
  const Surface s = build(wall(5, 4), 5, 4);
  expect_sound(s);
  EXPECT_EQ(s.positions.size(), 20U);
  EXPECT_EQ(s.triangles.size(), 2U * 4 * 3);
  for (const Triangle& t : s.triangles) {
    for (const std::uint32_t v : t) {
      EXPECT_LE(std::abs(s.grid[v].line - s.grid[t[0]].line), 1);
      EXPECT_LE(std::abs(s.grid[v].boundary - s.grid[t[0]].boundary), 1);
    }
  }
  for (const auto& n : s.normals) {
    EXPECT_NEAR(n[0], 0, 1e-5);
    EXPECT_NEAR(n[1], 0, 1e-5);
    EXPECT_NEAR(n[2], -1, 1e-5);
  }
}

TEST(Surface, NormalsOfASlope) {
  // z = 1 + 0.5 x, sampled where rays meet it.
  std::vector<GridVertex> vertices = wall(6, 6);
  for (GridVertex& v : vertices) {
    const float x = v.position[0];
    const float y = v.position[1];
    const float z = 1 / (1 - 0.5F * x);
    v.position = {x * z, y * z, z};
  }
  const Surface s = build(vertices, 6, 6);
  expect_sound(s);
  EXPECT_EQ(s.triangles.size(), 50U);
  const float length = std::sqrt(1.25F);
  for (const auto& n : s.normals) {
    EXPECT_NEAR(n[0], 0.5F / length, 1e-3);
    EXPECT_NEAR(n[1], 0, 1e-3);
    EXPECT_NEAR(n[2], -1 / length, 1e-3);
  }
}

TEST(Surface, CutAtADepthStep) {
  const auto step = [](int b, int) { return b < 3 ? 1.F : 1.2F; };
  const Surface s = build(grid(6, 4, step), 6, 4);
  expect_sound(s);
  EXPECT_EQ(s.positions.size(), 24U);
  EXPECT_EQ(s.triangles.size(), 2U * 2 * 3 * 2);  // two walls of 2 x 3 cells
  for (const Triangle& t : s.triangles) {
    const bool left = s.grid[t[0]].boundary < 3;
    for (const std::uint32_t v : t) EXPECT_EQ(s.grid[v].boundary < 3, left);
  }
}

TEST(Surface, TheCutIsAtTheRatio) {
  // One step across the view is 1 cm: the wall is cut where it goes back more than `ratio` centimetres.
  const auto steep = [](float rise) {
    return build(grid(2, 2, [&](int b, int) { return 1 + rise * static_cast<float>(b); }), 2, 2,
                 {.depth_step_ratio = 4, .least_facing = 0, .least_component = 1})
        .triangles.size();
  };
  EXPECT_EQ(steep(0.038F), 2U);
  EXPECT_EQ(steep(0.043F), 0U);
  EXPECT_EQ(steep(-0.037F), 2U);
  EXPECT_EQ(steep(-0.043F), 0U);
}

TEST(Surface, ThreeCornersMakeATriangle) {
  for (std::size_t missing = 0; missing < 4; ++missing) {
    std::vector<GridVertex> vertices = wall(2, 2);
    vertices.erase(vertices.begin() + static_cast<std::ptrdiff_t>(missing));
    const Surface s = build(vertices, 2, 2);
    expect_sound(s);
    EXPECT_EQ(s.positions.size(), 3U);
    EXPECT_EQ(s.triangles.size(), 1U) << missing;
  }
}

TEST(Surface, TheDiagonalJoinsTheCornersOfEqualDepth) {
  // One corner stands out: the cell folds along the diagonal between its neighbours.
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const int at_boundary = static_cast<int>(corner % 2);
    const int at_line = static_cast<int>(corner / 2);
    const auto z = [&](int b, int l) { return b == at_boundary && l == at_line ? 0.99F : 1.F; };
    const Surface s = build(grid(2, 2, z), 2, 2);
    ASSERT_EQ(s.triangles.size(), 2U);
    std::map<std::size_t, int> uses;
    for (const Triangle& t : s.triangles)
      for (const std::uint32_t v : t) ++uses[v];
    EXPECT_EQ(uses[corner], 1) << corner;
    EXPECT_EQ(uses[3 - corner], 1) << corner;
  }
}

TEST(Surface, ReversedOrderMakesNoTriangles) {
  // Boundaries that run right to left in the picture can only be seen through a fold, or wrongly decoded.
  std::vector<GridVertex> vertices = wall(4, 3);
  for (GridVertex& v : vertices) v.position[0] = -v.position[0];
  EXPECT_TRUE(build(vertices, 4, 3).triangles.empty());
  EXPECT_TRUE(build(vertices, 4, 3, {.least_component = 3}).positions.empty());
}

TEST(Surface, TrianglesSeenEdgeOnAreCurtains) {
  // One centimetre across the view a boundary; the triangle's normal is atan(rise / 1 cm) off the view.
  const auto triangles = [](float rise) {
    return build(grid(2, 2, [&](int b, int) { return 1 + rise * static_cast<float>(b); }), 2, 2,
                 {.depth_step_ratio = 100, .least_component = 1})
        .triangles.size();
  };
  EXPECT_EQ(triangles(0.03F), 2U);
  EXPECT_EQ(triangles(0.09F), 0U);
}

TEST(Surface, SmallPiecesGoAndAreCounted) {
  std::vector<GridVertex> vertices = wall(3, 3);
  vertices.push_back(vertex(8, 7));
  SurfaceScratch scratch;
  Surface without;
  EXPECT_EQ(
      build_surface(decoded_grid(vertices, 10, 9), {.least_component = 9}, scratch, without).small_component,
      1U);
  expect_sound(without);
  EXPECT_EQ(without.positions.size(), 9U);
  Surface none;
  EXPECT_EQ(
      build_surface(decoded_grid(vertices, 10, 9), {.least_component = 10}, scratch, none).small_component,
      10U);
  EXPECT_TRUE(none.positions.empty());
  EXPECT_TRUE(none.triangles.empty());
  const Surface with = build(vertices, 10, 9, {.least_component = 1});
  expect_sound(with);
  ASSERT_EQ(with.positions.size(), 10U);
  EXPECT_EQ(with.triangles, without.triangles);
  EXPECT_EQ(with.normals.back(), (Vec3f{0, 0, -1}));
}

TEST(Surface, ABoundaryThatGoesOnAloneIsKept) {
  constexpr int kLines = 30;
  const auto kept = [](int lines, float sigma_px, bool linked) {
    std::vector<GridVertex> vertices;
    for (int l = 0; l < lines; ++l) {
      vertices.push_back(vertex(2, l));
      vertices.back().at.sigma_px = sigma_px;
    }
    const DecodedGrid boundaries = decoded_grid(vertices, 5, kLines);
    GridLinks links;
    links.fit(boundaries);
    WorkerPool pool(1);
    if (linked) find_links(boundaries, {}, pool, links);
    SurfaceScratch scratch;
    Surface out;
    build_surface(boundaries, {.links = &links}, scratch, out);
    expect_sound(out);
    EXPECT_TRUE(out.triangles.empty());
    return out.positions.size();
  };
  EXPECT_EQ(kept(25, 0.05F, true), 25U);
  EXPECT_EQ(kept(12, 0.05F, true), 0U);   // shorter ones are most often wrong codes
  EXPECT_EQ(kept(25, 0.05F, false), 0U);  // as are those that jump from line to line
  EXPECT_EQ(kept(25, 0.3F, true), 0U);    // and none can tell of doubtful ones
}

TEST(Surface, OfTwoAtOnePlaceTheSteeperStays) {
  for (const bool first : {true, false}) {
    std::vector<GridVertex> vertices = wall(3, 3);
    GridVertex better = vertex(1, 1, 1.001F, 20);
    GridVertex worse = vertex(1, 1, 0.8F, 5);
    vertices.insert(vertices.begin(), first ? better : worse);
    vertices.push_back(first ? worse : better);
    const Surface s = build(vertices, 3, 3);
    expect_sound(s);
    ASSERT_EQ(s.positions.size(), 9U);
    EXPECT_EQ(s.positions[4], better.position);
  }
}

TEST(Surface, TheOrderOfVerticesMakesNoDifference) {
  std::vector<GridVertex> vertices = grid(12, 9, [](int b, int l) {
    return 1 + 0.01F * std::sin(0.7F * static_cast<float>(b)) + 0.3F * static_cast<float>(l > 5);
  });
  vertices.erase(vertices.begin() + 40, vertices.begin() + 44);
  GridVertex twin = vertices[10];  // of equal slope, a little off
  twin.at.column_px += 0.75F;
  twin.position[0] += 0.0005F;
  vertices.push_back(twin);
  const Surface straight = build(vertices, 12, 9);
  expect_sound(straight);
  ASSERT_FALSE(straight.triangles.empty());
  test::Random random(3);
  for (int round = 0; round < 20; ++round) {
    for (std::size_t i = vertices.size(); i > 1; --i)
      std::swap(vertices[i - 1], vertices[random.below(static_cast<std::uint32_t>(i))]);
    EXPECT_TRUE(same(build(vertices, 12, 9), straight)) << round;
  }
}

TEST(Surface, ScratchAndOutputAreReused) {
  SurfaceScratch scratch;
  Surface out;
  build_surface(decoded_grid(wall(20, 20), 20, 20), {}, scratch, out);
  build_surface(decoded_grid(wall(3, 2), 3, 2), {.least_component = 1}, scratch, out);
  EXPECT_TRUE(same(out, build(wall(3, 2), 3, 2)));
  build_surface(decoded_grid({}, 3, 2), {}, scratch, out);
  EXPECT_TRUE(out.positions.empty() && out.triangles.empty() && out.grid.empty() && out.normals.empty());
}

/// Pieces against a search that goes from triangle to triangle, over the words that lines are made of.
TEST(Surface, PiecesAreWhatTrianglesJoin) {
  for (const int boundaries : {5, 63, 64, 65, 130}) {
    constexpr int kLines = 40;
    test::Random random(static_cast<std::uint64_t>(boundaries));
    std::vector<GridVertex> vertices =
        grid(boundaries, kLines, [&](int, int) { return random.below(2) == 0 ? 1.F : 1.3F; });
    for (std::size_t i = vertices.size() / 4; i > 0; --i)
      vertices.erase(vertices.begin() + random.below(static_cast<std::uint32_t>(vertices.size())));
    const Surface all = build(vertices, boundaries, kLines, {.least_component = 0});
    ASSERT_EQ(all.positions.size(), vertices.size());
    std::vector<std::size_t> piece(vertices.size());
    std::iota(piece.begin(), piece.end(), std::size_t{0});
    for (bool changed = true; changed;) {
      changed = false;
      for (const Triangle& t : all.triangles) {
        const std::size_t least = std::min({piece[t[0]], piece[t[1]], piece[t[2]]});
        for (const std::uint32_t v : t) changed |= std::exchange(piece[v], least) != least;
      }
    }
    // Those that no triangle joins to the one beside them on the line count half.
    std::vector<int> weight(vertices.size(), 1);
    for (const Triangle& t : all.triangles)
      for (std::size_t c = 0; c < 3; ++c)
        if (all.grid[t[c]].line == all.grid[t[(c + 1) % 3]].line) weight[t[c]] = weight[t[(c + 1) % 3]] = 2;
    std::vector<int> size(vertices.size());
    for (std::size_t v = 0; v < piece.size(); ++v) size[piece[v]] += weight[v];
    for (const int least : {2, 3, 6, 20}) {
      const auto stays = [&](std::size_t v) { return size[piece[v]] + 1 >= 2 * least; };
      std::vector<Vec3f> expected;
      for (std::size_t v = 0; v < piece.size(); ++v)
        if (stays(v)) expected.push_back(all.positions[v]);
      std::size_t triangles = 0;
      for (const Triangle& t : all.triangles) triangles += stays(t[0]);
      const Surface kept = build(vertices, boundaries, kLines, {.least_component = least});
      EXPECT_EQ(kept.positions, expected) << boundaries << ", " << least;
      EXPECT_EQ(kept.triangles.size(), triangles) << boundaries << ", " << least;
    }
  }
}

}  // namespace
}  // namespace relievo
