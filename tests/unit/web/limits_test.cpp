// SPDX-License-Identifier: Apache-2.0
// Proves: rates and connections of an address are bounded, recover, and are forgotten.
#include "web/gateway/limits.h"

#include <gtest/gtest.h>

#include "base/time.h"

namespace relievo {
namespace {

TEST(Bucket, GivesItsBurstAndThenItsRate) {
  Bucket bucket({.per_s = 10, .burst = 5}, 0);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(bucket.take(0)) << i;
  EXPECT_FALSE(bucket.take(0));
  EXPECT_FALSE(bucket.take(kNanosecondsPerSecond / 20)) << "half of one";
  EXPECT_TRUE(bucket.take(kNanosecondsPerSecond / 10));
  EXPECT_FALSE(bucket.take(kNanosecondsPerSecond / 10));
  EXPECT_FALSE(bucket.take(0)) << "a clock that goes back gives nothing";
  const std::int64_t later_ns = 100 * kNanosecondsPerSecond;
  EXPECT_TRUE(bucket.full(later_ns));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(bucket.take(later_ns)) << "no more than the burst is saved up";
  EXPECT_FALSE(bucket.take(later_ns));
}

TEST(AddressLimits, CountEachAddressByItself) {
  AddressLimits limits(2, {.per_s = 1, .burst = 1});
  EXPECT_TRUE(limits.connect("a", 0));
  EXPECT_TRUE(limits.connect("a", 0));
  EXPECT_FALSE(limits.connect("a", 0));
  EXPECT_TRUE(limits.connect("b", 0));
  limits.disconnect("a");
  EXPECT_TRUE(limits.connect("a", 0));
  EXPECT_TRUE(limits.request("a", 0));
  EXPECT_FALSE(limits.request("a", 0));
  EXPECT_TRUE(limits.request("b", 0));
  limits.disconnect("never seen");
}

TEST(AddressLimits, ForgetWhoOwesNothing) {
  AddressLimits limits(2, {.per_s = 1, .burst = 10});
  ASSERT_TRUE(limits.connect("stays", 0));
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t now_ns = i * kNanosecondsPerSecond;
    const std::string address = std::to_string(i);
    ASSERT_TRUE(limits.connect(address, now_ns));
    limits.disconnect(address);
  }
  EXPECT_LT(limits.size(), 10'000u);
  EXPECT_TRUE(limits.connect("stays", 0));
  EXPECT_FALSE(limits.connect("stays", 0)) << "its first connection was forgotten";
}

}  // namespace
}  // namespace relievo
