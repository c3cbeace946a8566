// SPDX-License-Identifier: Apache-2.0
#include "cli/quantities.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

TEST(Quantities, SizesAsPeopleWriteThem) {
  EXPECT_EQ(parse_bytes("4096").value(), 4096u);
  EXPECT_EQ(parse_bytes("500MB").value(), 500'000'000u);
  EXPECT_EQ(parse_bytes("2 GB").value(), 2'000'000'000u);
  EXPECT_EQ(parse_bytes("1.5gb").value(), 1'500'000'000u);
  EXPECT_EQ(parse_bytes("3MiB").value(), 3u << 20);
  for (const char* wrong : {"", "GB", "-1MB", "0", "5 apples", "nan", "inf", "1e300", "1GBx", "0.1B"}) {
    const auto bytes = parse_bytes(wrong);
    ASSERT_FALSE(bytes.ok()) << wrong;
    EXPECT_NE(bytes.error().message.find("such as 500MB"), std::string::npos);
    EXPECT_EQ(byte_count()(wrong), bytes.error().message);
  }
  EXPECT_EQ(byte_count()("2GB"), "");
}

TEST(Quantities, BitRatesAsPeopleWriteThem) {
  EXPECT_EQ(parse_bit_rate("4M").value(), 4e6);
  EXPECT_EQ(parse_bit_rate("2.5 Mbit/s").value(), 2.5e6);
  EXPECT_EQ(parse_bit_rate("800k").value(), 8e5);
  EXPECT_EQ(parse_bit_rate("4000000").value(), 4e6);
  for (const char* wrong : {"", "M", "-4M", "0", "4", "99k", "2G", "4MB", "nan"}) {
    EXPECT_FALSE(parse_bit_rate(wrong).ok()) << wrong;
    EXPECT_NE(bit_rate()(wrong), "") << wrong;
  }
}

TEST(Quantities, DurationsAsPeopleWriteThem) {
  EXPECT_EQ(parse_duration_s("90").value(), 90);
  EXPECT_EQ(parse_duration_s("0.5s").value(), 0.5);
  EXPECT_EQ(parse_duration_s("10min").value(), 600);
  EXPECT_EQ(parse_duration_s("1.5 h").value(), 5400);
  EXPECT_EQ(parse_duration_s("30d").value(), 30 * 86400);
  for (const char* wrong : {"", "min", "-1s", "0", "10m", "nan", "1e300"}) {
    EXPECT_FALSE(parse_duration_s(wrong).ok()) << wrong;
    EXPECT_NE(duration()(wrong), "") << wrong;
  }
}

}  // namespace
}  // namespace relievo
