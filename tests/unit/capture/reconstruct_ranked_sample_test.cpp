// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/ranked_sample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace relievo {
namespace {

/// Every rank against a sort, however values are shared out and whatever they are.
TEST(RankedSample, RanksAsASortDoes) {
  std::mt19937 random(2);
  std::normal_distribution<float> normal(0, 1);
  constexpr float kLargest = std::numeric_limits<float>::max();
  RankedSample sample;
  for (const int workers : {1, 3}) {
    for (const std::size_t size : {1U, 2U, 9U, 500U, 5000U}) {
      for (const int kind : {0, 1, 2, 3}) {
        std::vector<float> all;
        for (std::size_t i = 0; i < size; ++i) {
          const float v = normal(random);
          all.push_back(kind == 0   ? v
                        : kind == 1 ? 1 + 1e-3F * v
                        : kind == 2 ? std::round(2 * v)
                                    : (i % 10 == 0 ? std::copysign(kLargest, v) : std::exp(9 * v)));
        }
        sample.reset(workers);
        for (std::size_t i = 0; i < size; ++i) sample.of(static_cast<int>(i) % workers).push_back(all[i]);
        ASSERT_EQ(sample.size(), size);
        std::sort(all.begin(), all.end());
        for (std::size_t rank = 0; rank < size; rank += 1 + size / 50) ASSERT_EQ(sample.at(rank), all[rank]);
        ASSERT_EQ(sample.at(size - 1), all[size - 1]);
        ASSERT_EQ(sample.median(-1), all[size / 2]);
      }
    }
  }
}

TEST(RankedSample, OfNothingHasTheMedianThatIsAskedFor) {
  RankedSample sample;
  sample.reset(2);
  EXPECT_EQ(sample.size(), 0U);
  EXPECT_EQ(sample.median(0.25F), 0.25F);
  sample.of(1).push_back(7);
  EXPECT_EQ(sample.median(0.25F), 7);
  sample.reset(2);
  EXPECT_EQ(sample.size(), 0U);
}

}  // namespace
}  // namespace relievo
