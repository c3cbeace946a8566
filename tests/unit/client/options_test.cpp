// SPDX-License-Identifier: Apache-2.0
// Proves: what people read of sizes and durations is short, and in units that they think in.
#include "client/options.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(DurationText, IsOfTheUnitsThatMatter) {
  EXPECT_EQ(duration_text(4.5), "4.50 s");
  EXPECT_EQ(duration_text(125.9), "2 min 5 s");
  EXPECT_EQ(duration_text(3599), "59 min 59 s");
  EXPECT_EQ(duration_text(43'199.9), "11 h 59 min");
  EXPECT_EQ(duration_text(93'900), "26 h 5 min");
}

}  // namespace
}  // namespace relievo
