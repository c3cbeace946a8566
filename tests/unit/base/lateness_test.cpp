// SPDX-License-Identifier: Apache-2.0
// Proves: queues on the way are told from clocks that disagree.
#include "base/lateness.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kFrame_ns = 33'000'000;

/// Frames for so long, each of which takes what `way_ns` says.
template <typename Way>
std::int64_t run(Lateness& lateness, std::int64_t& now_ns, std::int64_t for_ns, const Way& way_ns) {
  std::int64_t most_ns = 0;
  for (const std::int64_t end_ns = now_ns + for_ns; now_ns < end_ns; now_ns += kFrame_ns)
    most_ns = std::max(most_ns, lateness.add(now_ns, way_ns(now_ns)));
  return most_ns;
}

TEST(Lateness, ADifferenceOfTheClocksIsNone) {
  for (const std::int64_t difference_ns : {std::int64_t{0}, -5 * kSecond_ns, 3600 * kSecond_ns}) {
    Lateness lateness;
    std::int64_t now_ns = 0;
    EXPECT_EQ(run(lateness, now_ns, 100 * kSecond_ns, [&](auto) { return difference_ns; }), 0);
  }
}

TEST(Lateness, AQueueIsSeenAsLongAsItIs) {
  Lateness lateness;
  std::int64_t now_ns = 0;
  run(lateness, now_ns, kSecond_ns, [](auto) { return -7'000'000; });
  EXPECT_EQ(lateness.add(now_ns, 493'000'000), 500'000'000);
  EXPECT_EQ(lateness.add(now_ns, -7'000'000), 0);
}

TEST(Lateness, ClocksThatDriftAreNone) {
  Lateness lateness;
  std::int64_t now_ns = 0;
  const auto drifting = [](std::int64_t at_ns) { return at_ns / 10'000; };  // 100 in a million
  EXPECT_LT(run(lateness, now_ns, 3600 * kSecond_ns, drifting), 10'000'000);
}

TEST(Lateness, AClockThatIsSetIsForgotten) {
  for (const std::int64_t step_ns : {-10 * kSecond_ns, 10 * kSecond_ns}) {
    Lateness lateness;
    std::int64_t now_ns = 0;
    run(lateness, now_ns, 10 * kSecond_ns, [](auto) { return 0; });
    run(lateness, now_ns, 2 * Lateness::kRemembered_ns, [&](auto) { return step_ns; });
    EXPECT_EQ(lateness.add(now_ns, step_ns), 0);
  }
}

TEST(Lateness, StampsOfAHostilePeerDoNoHarm) {
  Lateness lateness;
  const auto least = std::numeric_limits<std::int64_t>::min(),
             most = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(lateness.add(0, least), 0);
  EXPECT_EQ(lateness.add(1, most), 0);
}

}  // namespace
}  // namespace relievo
