// SPDX-License-Identifier: Apache-2.0
#include "base/time.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(UtcText, AsIso8601OrAsAsked) {
  constexpr std::int64_t kTime_ns = 1'700'000'000 * kNanosecondsPerSecond + 999'999'999;
  EXPECT_EQ(utc_text(kTime_ns), "2023-11-14T22:13:20Z");
  EXPECT_EQ(utc_text(kTime_ns, "%Y%m%dT%H%M%S"), "20231114T221320");
  EXPECT_EQ(utc_text(-1), "1969-12-31T23:59:59Z");
}

}  // namespace
}  // namespace relievo
