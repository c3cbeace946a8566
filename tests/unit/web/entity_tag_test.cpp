// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/entity_tag.h"

#include <gtest/gtest.h>

namespace relievo::test {
namespace {

constexpr const char* kEtag = "\"a-1\"";

TEST(EntityTag, WhoHasItIsNotSentItAgain) {
  for (const char* has : {"\"a-1\"", "W/\"a-1\"", "*", "\"b\", \"a-1\"", "\"b\",W/\"a-1\" , \"c\"",
                          ",\t\"a-1\"", "\"with, a comma\", \"a-1\""})
    EXPECT_EQ(failed_condition("", has, kEtag), 304) << has;
  for (const char* lacks : {"", "\"b\"", "a-1", "\"a-1", "w/\"a-1\"", "\"b\" x \"a-1\"", "\"a-1 \"", "**",
                            "W/", ",", "\"", "\"*\""})
    EXPECT_EQ(failed_condition("", lacks, kEtag), std::nullopt) << lacks;
}

TEST(EntityTag, WhoWantsThatOneAloneIsSentNoOther) {
  for (const char* wanted : {"", "\"a-1\"", "*", "\"b\", \"a-1\""})
    EXPECT_EQ(failed_condition(wanted, "", kEtag), std::nullopt) << wanted;
  for (const char* other : {"\"b\"", "W/\"a-1\"", "a-1", "\"b\", W/\"a-1\""})
    EXPECT_EQ(failed_condition(other, "", kEtag), 412) << other;
  EXPECT_EQ(failed_condition("\"b\"", kEtag, kEtag), 412) << "that comes first";
}

}  // namespace
}  // namespace relievo::test
