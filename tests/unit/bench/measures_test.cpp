// SPDX-License-Identifier: Apache-2.0
// What the benchmarks compute: spreads, and the error of a decoded surface.
#include <gtest/gtest.h>

#include <cmath>

#include "bench/report.h"
#include "bench/surface_error.h"

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

/// A wall of 20 x 20 vertices, 1 cm apart.
Surface wall() {
  Surface surface;
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      surface.positions.push_back({0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), 1});
      surface.texture_coordinates.push_back({static_cast<float>(x) / 19, static_cast<float>(y) / 19});
    }
  }
  return surface;
}

TEST(SurfaceError, OfTheSameSurfaceIsNone) {
  const auto error = surface_error(wall(), wall());
  ASSERT_TRUE(error);
  EXPECT_EQ(error->rms_m, 0);
  EXPECT_EQ(error->max_m, 0);
}

TEST(SurfaceError, PermutedThinnedAndMoved) {
  // Every second vertex, last first; one of them 3 cm nearer, where another encoded vertex is nearer in
  // space.
  const Surface encoded = wall();
  Surface decoded;
  for (std::size_t i = encoded.positions.size(); i-- > 0;) {
    if (i % 2 != 0) continue;
    decoded.positions.push_back(encoded.positions[i]);
    Vec2f coordinate = encoded.texture_coordinates[i];
    coordinate[0] = std::round(coordinate[0] * 4095) / 4095;  // as a codec quantises them
    decoded.texture_coordinates.push_back(coordinate);
  }
  decoded.positions[7][0] += 0.03F;
  const auto error = surface_error(encoded, decoded);
  ASSERT_TRUE(error) << error.error().message;
  EXPECT_NEAR(error->max_m, 0.03, 1e-6);
  EXPECT_NEAR(error->rms_m, 0.03 / std::sqrt(200), 1e-6);
}

TEST(SurfaceError, AVertexThatWasNeverEncodedIsNoMatch) {
  Surface decoded = wall();
  decoded.texture_coordinates[5] = {0.5F / 19, 0.5F / 19};
  EXPECT_FALSE(surface_error(wall(), decoded));
  decoded = wall();
  decoded.texture_coordinates.clear();
  EXPECT_FALSE(surface_error(wall(), decoded));
}

}  // namespace
}  // namespace relievo::bench
