// SPDX-License-Identifier: Apache-2.0
// Proves: the offset between two clocks is found within half the shortest way, also over lopsided ways, and
// impossible stamps change nothing.
#include "base/clock_offset.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

namespace relievo {
namespace {

constexpr std::int64_t kAhead_ns = -3'700'000'000;  // theirs

ClockExchange exchange(std::int64_t at_ns, std::int64_t out_ns, std::int64_t back_ns) {
  constexpr std::int64_t kThere_ns = 50'000;
  const std::int64_t heard_ns = at_ns + out_ns + kAhead_ns;
  return {at_ns, heard_ns, heard_ns + kThere_ns, at_ns + out_ns + kThere_ns + back_ns};
}

TEST(ClockEstimate, KnowsNothingAtFirst) {
  EXPECT_FALSE(ClockEstimate().best());
}

TEST(ClockEstimate, IsExactOverEvenWays) {
  ClockEstimate estimate;
  estimate.add(exchange(1'000, 200'000, 200'000));
  ASSERT_TRUE(estimate.best());
  EXPECT_EQ(estimate.best()->offset_ns, kAhead_ns);
  EXPECT_EQ(estimate.best()->delay_ns, 400'000);
}

TEST(ClockEstimate, TakesTheShortestWayOfTheLastOnes) {
  ClockEstimate estimate;
  for (int i = 0; i < 5; ++i) estimate.add(exchange(i * 1'000'000'000LL, 9'000'000, 300'000));
  estimate.add(exchange(6'000'000'000, 210'000, 190'000));
  for (int i = 7; i < 12; ++i) estimate.add(exchange(i * 1'000'000'000LL, 100'000, 40'000'000));
  EXPECT_EQ(estimate.best()->delay_ns, 400'000);
  EXPECT_LE(std::abs(estimate.best()->offset_ns - kAhead_ns), 200'000);
  for (int i = 0; i < static_cast<int>(ClockEstimate::kExchanges); ++i)
    estimate.add(exchange(20'000'000'000 + i, 1'000'000, 1'000'000));
  EXPECT_EQ(estimate.best()->delay_ns, 2'000'000) << "a clock drifts: what is long ago no longer counts";
}

TEST(ClockEstimate, IgnoresTheImpossible) {
  ClockEstimate estimate;
  constexpr auto kMost = std::numeric_limits<std::int64_t>::max();
  constexpr auto kLeast = std::numeric_limits<std::int64_t>::min();
  estimate.add({10, 5, 4, 20});             // answered before it was heard
  estimate.add({10, 5, 50, 20});            // took longer there than here
  estimate.add({10, 5, 5, 9});              // back before it was asked
  estimate.add({10, kMost, kMost, 20});     // their clock shows the end of time:
  estimate.add({-10, kLeast, kLeast, 20});  // sums that do not fit
  estimate.add({kLeast, 0, 0, kMost});
  EXPECT_FALSE(estimate.best());
}

}  // namespace
}  // namespace relievo
