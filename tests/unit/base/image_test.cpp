// SPDX-License-Identifier: Apache-2.0
#include "base/image.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(Image, FieldsAreEverySecondRow) {
  Image8 image(3, 5, 1);
  for (int y = 0; y < 5; ++y) image.row(y)[2] = static_cast<std::uint8_t>(10 * y);
  const View8 even = image.view().field(0);
  const View8 odd = image.view().field(1);
  EXPECT_EQ(even.height, 3);
  EXPECT_EQ(odd.height, 2);
  EXPECT_EQ(even.row(2)[2], 40);
  EXPECT_EQ(odd.row(1)[2], 30);
}

}  // namespace
}  // namespace relievo
