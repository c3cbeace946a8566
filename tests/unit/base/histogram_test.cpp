// SPDX-License-Identifier: Apache-2.0
// Proves: a histogram counts up to each bound, and what came between two looks at one is told from nonsense.
#include "base/histogram.h"

#include <gtest/gtest.h>

#include <limits>

namespace relievo {
namespace {

TEST(Histogram, CountsUpToEachBound) {
  Histogram h;
  for (const double s : {-1.0, 0.001, 0.0011, 5.0, 5.1}) h.add(s);
  EXPECT_EQ(h.counts.front(), 2U);
  EXPECT_EQ(h.counts[1], 1U);
  EXPECT_EQ(h.counts[Histogram::kBounds_s.size() - 1], 1U);
  EXPECT_EQ(h.counts.back(), 1U);
  EXPECT_DOUBLE_EQ(h.sum_s, 0.001 + 0.0011 + 5.0 + 5.1);
}

TEST(Histogram, WhatCameSince) {
  Histogram before;
  before.add(0.5);
  Histogram now = before;
  now.add(0.25);
  const auto more = now.since(before);
  ASSERT_TRUE(more);
  Histogram sum = before;
  sum += *more;
  EXPECT_EQ(sum.counts, now.counts);
  EXPECT_DOUBLE_EQ(sum.sum_s, now.sum_s);
  EXPECT_FALSE(before.since(now)) << "counts only rise";
  Histogram shrunk = now;
  shrunk.sum_s = 0.1;
  EXPECT_FALSE(shrunk.since(now));
  now.sum_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(now.since(before));
}

}  // namespace
}  // namespace relievo
