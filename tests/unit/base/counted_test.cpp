// SPDX-License-Identifier: Apache-2.0
#include "base/counted.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(Counted, OneIsNoPlural) {
  EXPECT_EQ(counted(0, "frame"), "0 frames");
  EXPECT_EQ(counted(1, "more topic"), "1 more topic");
  EXPECT_EQ(counted(12, "frame") + " " + is_or_are(12), "12 frames are");
  EXPECT_STREQ(is_or_are(1), "is");
}

}  // namespace
}  // namespace relievo
