// SPDX-License-Identifier: Apache-2.0
// Proves: a client finds how far the server's clock is off, within half of the way there and back, over real
// DDS; several clients do not disturb each other.
#include <gtest/gtest.h>

#include <cstdlib>

#include "base/time.h"
#include "idl/transport.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/streams.h"

namespace relievo {
namespace {

constexpr std::int64_t kAhead_ns = 3'700'000'000;
const DomainOptions kDomain{test::own_domain(), "lo"};

/// Asks until an answer is there.
std::optional<ClockOffset> measured(ClockProbe& probe) {
  test::eventually([&] {
    probe.ask();
    return probe.offset().has_value();
  });
  return probe.offset();
}

TEST(Clock, OffsetOfAServerWhoseClockIsAhead) {
  const auto publisher =
      Publisher::create(kDomain, test::example_info("ahead"), {}, [] { return utc_now_ns() + kAhead_ns; });
  ASSERT_TRUE(publisher);
  const auto one = ClockProbe::create(kDomain, "ahead");
  const auto other = ClockProbe::create(kDomain, "ahead");
  ASSERT_TRUE(one && other);
  for (ClockProbe* const probe : {one->get(), other->get()}) {
    const auto clock = measured(*probe);
    ASSERT_TRUE(clock);
    EXPECT_LE(std::abs(clock->offset_ns - kAhead_ns), clock->delay_ns / 2 + 1000);
    EXPECT_GT(clock->delay_ns, 0);
  }
}

TEST(Clock, AServerIsAskedForItsOwnStreamAlone) {
  const auto publisher =
      Publisher::create(kDomain, test::example_info("mine"), {}, [] { return utc_now_ns() - kAhead_ns; });
  const auto beside = Publisher::create(kDomain, test::example_info("beside"));
  ASSERT_TRUE(publisher && beside);
  const auto mine = ClockProbe::create(kDomain, "mine");
  const auto theirs = ClockProbe::create(kDomain, "beside");
  const auto nobodys = ClockProbe::create(kDomain, "nobody");
  ASSERT_TRUE(mine && theirs && nobodys);
  (*nobodys)->ask();
  const auto clock = measured(**mine);
  const auto other = measured(**theirs);
  ASSERT_TRUE(clock && other);
  EXPECT_LE(std::abs(clock->offset_ns + kAhead_ns), clock->delay_ns / 2 + 1000);
  EXPECT_LE(std::abs(other->offset_ns), other->delay_ns / 2 + 1000);
  EXPECT_FALSE((*nobodys)->offset());
}

TEST(Clock, NeedsTheNameOfAStream) {
  EXPECT_FALSE(ClockProbe::create(kDomain, ""));
  EXPECT_FALSE(ClockProbe::create(kDomain, "a/b"));
}

}  // namespace
}  // namespace relievo
