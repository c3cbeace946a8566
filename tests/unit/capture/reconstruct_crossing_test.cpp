// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/crossing.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>

#include "capture/reconstruct/four.h"

namespace relievo {
namespace {

using Row = std::array<float, 4>;  // columns -1 to 2

/// A step from -100 to 100 at `place`, blurred by a normal distribution's sigma.
Row edge(float place, float sigma_px) {
  Row out{};
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = 100 * std::erf((static_cast<float>(i) - 1 - place) / (std::sqrt(2.F) * sigma_px));
  return out;
}

TEST(Crossing, OfAnEdgeAsCamerasHaveThemIsNearerThanAStraightLines) {
  for (const float sigma : {0.9F, 1.F, 1.1F, 1.2F}) {
    SCOPED_TRACE(sigma);
    float worst = 0;
    float worst_straight = 0;
    for (float place = 0.02F; place < 1; place += 0.02F) {
      const Row row = edge(place, sigma);
      worst = std::max(worst, std::fabs(crossing_behind(&row[1], 0) - place));
      worst_straight = std::max(worst_straight, std::fabs(row[1] / (row[1] - row[2]) - place));
    }
    EXPECT_GT(worst_straight, 0.008F);
    EXPECT_LT(worst, 0.3F * worst_straight);
  }
}

TEST(Crossing, OfAWideEdgeIsTheStraightLines) {
  // Its bend would be noise alone.
  const Row row = edge(0.3F, 3);
  EXPECT_EQ(crossing_behind(&row[1], 0), row[1] / (row[1] - row[2]));
}

TEST(Crossing, GoesBothWaysAndToAnyLevel) {
  Row row = edge(0.7F, 1);
  const float place = crossing_behind(&row[1], 0);
  for (float& s : row) s = 50 - s;
  EXPECT_NEAR(crossing_behind(&row[1], 50), place, 1e-5);
}

TEST(Crossing, IsBetweenItsSamplesWhateverIsBesideThem) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> any(-100, 100);
  for (int i = 0; i < 10000; ++i) {
    Row row{any(random), any(random), any(random), any(random)};
    if (row[1] * row[2] >= 0) continue;
    const float place = crossing_behind(&row[1], 0);
    ASSERT_GE(place, 0);
    ASSERT_LE(place, 1);
  }
}

TEST(Crossing, ManyAtOnceAreEachAsAlone) {
  std::array<Four, 4> rows{};
  std::array<float, 4> alone{};
  for (std::size_t i = 0; i < 4; ++i) {
    const Row row = edge(0.1F + 0.25F * static_cast<float>(i), 0.7F + 0.4F * static_cast<float>(i));
    for (std::size_t s = 0; s < 4; ++s) rows[s][i] = row[s];
    alone[i] = crossing_behind(&row[1], 0);
  }
  Four together;
  crossing_of(rows[0], rows[1], rows[2], rows[3], together);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(together[i], alone[i]);
}

}  // namespace
}  // namespace relievo
