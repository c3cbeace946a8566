// SPDX-License-Identifier: Apache-2.0
#include "cli/checks.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(Checks, WholeNumbersWithinTheirLimits) {
  const ValueCheck check = whole_number(1, 1000);
  EXPECT_EQ(check("1"), "");
  EXPECT_EQ(check("1000"), "");
  for (const char* wrong : {"", "0", "-1", "1001", "1.5", "1e2", "0x10", " 1", "1 ", "many"}) {
    EXPECT_EQ(check(wrong), "'" + std::string(wrong) + "' is no whole number from 1 to 1000");
  }
}

TEST(Checks, WholeNumbersDoNotOverflow) {
  const ValueCheck check = whole_number(1);
  EXPECT_EQ(check("18446744073709551615"), "");
  EXPECT_EQ(check("18446744073709551616"), "'18446744073709551616' is no whole number of at least 1");
}

TEST(Checks, NumbersAreFiniteAndWithinTheirLimits) {
  const ValueCheck check = number(0.1, 3600);
  EXPECT_EQ(check("0.1"), "");
  EXPECT_EQ(check("3600"), "");
  for (const char* wrong : {"", "0", "nan", "inf", "-inf", "1e400", "1,5", "3600.1"}) {
    EXPECT_EQ(check(wrong), "'" + std::string(wrong) + "' is no number from 0.1 to 3600");
  }
  EXPECT_EQ(number(0)("inf"), "'inf' is no number of at least 0");
}

TEST(Checks, FoldersAreNotNamedAsFiles) {
  for (const char* name : {"a.png", "b/a.PLY", "./x.mcap"}) EXPECT_NE(folder_name()(name), "") << name;
  for (const char* name : {"a", "a.b", "take.2026", "a.png/b", "../a.png/", "png", ".png"})
    EXPECT_EQ(folder_name()(name), "") << name;
  for (const char* name : {"a.png", "a.PNG"}) EXPECT_EQ(png_name()(name), "") << name;
  for (const char* name : {"a", "a.jpg", "a.png.pdf"}) EXPECT_NE(png_name()(name), "") << name;
}

TEST(Checks, AddressesToListenAt) {
  EXPECT_EQ(listen_address()("127.0.0.1:8080"), "");
  EXPECT_NE(listen_address()("none"), "");
  EXPECT_EQ(listen_address(true)("none"), "");
  EXPECT_NE(listen_address(true)("127.0.0.1:99999"), "");
}

}  // namespace
}  // namespace relievo
