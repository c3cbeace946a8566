// SPDX-License-Identifier: Apache-2.0
// What the benchmarks compute: spreads, and the error of a decoded surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bench/report.h"
#include "bench/surface_error.h"
#include "tests/support/make_grid.h"

namespace relievo::bench {
namespace {

TEST(Spread, OfAHundredInAnyOrder) {
  std::vector<double> values;
  for (int i = 0; i < 100; ++i) values.push_back((i * 37) % 100 + 1);  // 1..100
  const Spread spread = spread_of(values);
  EXPECT_EQ(spread.n, 100U);
  EXPECT_EQ(spread.min, 1);
  EXPECT_EQ(spread.p10, 10);
  EXPECT_EQ(spread.median, 50);
  EXPECT_EQ(spread.p90, 90);
  EXPECT_EQ(spread.p99, 99);
  EXPECT_EQ(spread.max, 100);
}

TEST(Spread, OfOneAndOfNone) {
  const Spread one = spread_of({3});
  EXPECT_EQ(one.n, 1U);
  EXPECT_EQ(one.p10, 3);
  EXPECT_EQ(one.p99, 3);
  EXPECT_EQ(spread_of({}).n, 0U);
}

const test::GridScene kScene;
const Rig kRig = test::grid_rig(kScene);
const Pattern kPattern = test::grid_pattern(kScene);

TEST(SurfaceError, OfTheSameSurfaceIsNone) {
  const Surface surface = test::grid_frame(kScene).surface;
  const auto error = surface_error(surface, surface, kRig, kPattern);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_EQ(error->rms_m, 0);
  EXPECT_EQ(error->max_m, 0);
}

TEST(SurfaceError, PermutedThinnedAndMoved) {
  // Every second vertex, last first; one of them moved along its ray by less than a stripe.
  const Surface encoded = test::grid_frame(kScene).surface;
  Surface decoded;
  for (std::size_t i = encoded.positions.size(); i-- > 0;)
    if (i % 2 == 0) decoded.positions.push_back(encoded.positions[i]);
  Vec3f& moved = decoded.positions[7];
  const double length = std::hypot(moved[0], moved[1], moved[2]);
  for (float& x : moved) x *= 1 + static_cast<float>(0.002 / length);
  const auto error = surface_error(encoded, decoded, kRig, kPattern);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_NEAR(error->max_m, 0.002, 1e-6);
  EXPECT_NEAR(error->rms_m, 0.002 / std::sqrt(static_cast<double>(decoded.positions.size())), 1e-6);
}

TEST(SurfaceError, VerticesThatShareAPlaceInTheTextureAreNotMixedUp) {
  // At a depth step two boundaries are seen at one column of a line. Their texture coordinates cannot tell
  // them apart.
  Surface encoded = test::grid_frame(kScene).surface;
  std::size_t a = 0;
  while (encoded.grid[a + 1].line != encoded.grid[a].line ||
         encoded.grid[a].boundary + 1 != encoded.grid[a + 1].boundary)
    ++a;
  const Triangulator triangulator(kRig, kPattern, kScene.height / 2, 2);
  encoded.grid[a].column_px = encoded.grid[a + 1].column_px;
  encoded.positions[a] =
      *triangulator.point(encoded.grid[a].boundary, encoded.grid[a].line, encoded.grid[a].column_px);
  encoded.texture_coordinates[a] = encoded.texture_coordinates[a + 1];
  const auto error = surface_error(encoded, encoded, kRig, kPattern);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_EQ(error->max_m, 0);
}

TEST(SurfaceError, OfACodecWhoseStepsAreWiderThanAStripe) {
  const Surface encoded = test::grid_frame(kScene).surface;
  Surface decoded = test::grid_frame(kScene).surface;
  double most = 0;
  for (Vec3f& p : decoded.positions) {
    const Vec3f was = p;
    for (float& x : p) x *= 1.05F;  // along its ray, over several stripes
    most = std::max<double>(most, std::hypot(p[0] - was[0], p[1] - was[1], p[2] - was[2]));
  }
  const auto error = surface_error(encoded, decoded, kRig, kPattern);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_NEAR(error->max_m, most, 1e-6);
}

TEST(SurfaceError, OfACodecThatMovesAColumnFurtherThanToItsNeighbour) {
  const Surface encoded = test::grid_frame(kScene).surface;
  Surface decoded = test::grid_frame(kScene).surface;
  const auto& was = encoded.grid[5];
  const float column_px = was.column_px + 9;
  const Triangulator triangulator(kRig, kPattern, kScene.height / 2, 2);
  decoded.positions[5] = *triangulator.point(was.boundary, was.line, column_px);
  decoded.texture_coordinates[5][0] = (column_px + 0.5F) / static_cast<float>(kRig.camera.width);
  const auto error = surface_error(encoded, decoded, kRig, kPattern);
  ASSERT_TRUE(error) << error.error().message;
  const Vec3f &a = encoded.positions[5], &b = decoded.positions[5];
  EXPECT_NEAR(error->max_m, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), 1e-6);
}

TEST(SurfaceError, AVertexThatWasNeverEncodedIsNoMatch) {
  const Surface encoded = test::grid_frame(kScene).surface;
  Surface decoded = test::grid_frame(kScene).surface;
  Surface thinned = test::grid_frame(kScene).surface;
  thinned.positions.erase(thinned.positions.begin() + 5);
  thinned.grid.erase(thinned.grid.begin() + 5);
  EXPECT_FALSE(surface_error(thinned, decoded, kRig, kPattern));
  decoded.positions[5] = {0, 0, -1};
  EXPECT_FALSE(surface_error(encoded, decoded, kRig, kPattern));
  thinned.grid.clear();
  EXPECT_FALSE(surface_error(thinned, encoded, kRig, kPattern));
}

}  // namespace
}  // namespace relievo::bench
