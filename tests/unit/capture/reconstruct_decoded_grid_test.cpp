// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/decoded_grid.h"

#include <gtest/gtest.h>

#include <cmath>

namespace relievo {
namespace {

TEST(DecodedGrid, HoldsNothingWithinItsMarginEither) {
  DecodedGrid grid;
  for (const int boundaries : {1, 8, 89, 299}) {
    grid.reset(boundaries, 5);
    for (int line = 0; line < 5; ++line) grid.put(line, boundaries - 1, 3, 0.1F, 1);
    for (int line = -DecodedGrid::kMargin; line < 5 + DecodedGrid::kMargin; ++line) {
      for (int b = -DecodedGrid::kMargin; b < boundaries + 16; ++b) {
        const bool put = line >= 0 && line < 5 && b == boundaries - 1;
        EXPECT_EQ(std::isnan(grid.column_px(line)[b]), !put) << line << ", " << b;
        EXPECT_TRUE(std::isnan(grid.z(line)[b])) << line << ", " << b;
      }
    }
    grid.start_line(2);
    EXPECT_TRUE(std::isnan(grid.column_px(2)[boundaries - 1]));
    EXPECT_EQ(grid.column_px(1)[boundaries - 1], 3);
  }
}

TEST(DecodedGrid, OfTwoAtOnePlaceTheSteeperStaysAndBothAreTold) {
  struct Seen {
    float column_px, sigma_px, slope;
  };
  const Seen better{10, 0.1F, 20}, worse{12, 0.2F, 5}, as_steep{11, 0.3F, 20};
  for (const auto& [first, second] :
       {std::pair{better, worse}, {worse, better}, {better, as_steep}, {as_steep, better}}) {
    DecodedGrid grid;
    grid.reset(4, 3);
    EXPECT_TRUE(grid.put(1, 2, first.column_px, first.sigma_px, first.slope));
    EXPECT_FALSE(grid.put(1, 2, second.column_px, second.sigma_px, second.slope));
    EXPECT_EQ(grid.column_px(1)[2], 10);
    EXPECT_EQ(grid.sigma_px(1)[2], 0.1F);
    EXPECT_EQ(grid.slope(1)[2], 20);
  }
}

}  // namespace
}  // namespace relievo
