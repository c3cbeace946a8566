// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/pattern_check.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

const std::vector<Primary> kThree = {1, 2, 4};

// The path that the paper's Table 1 was made from: 00 11 22 00 12 ...
std::vector<int> table_1_path() {
  const char* text =
      "00 11 22 00 12 21 00 21 12 00 22 01 20 12 01 12 20 01 10 01 22 10 02 20 02 21 10 21 02 10 22 11 20 11 "
      "02 11 00";
  std::vector<int> path;
  for (const char* c = text; *c; c += c[2] ? 3 : 2) path.push_back((c[0] - '0') * 3 + c[1] - '0');
  return path;
}

TEST(PatternCheck, AcceptsTheWholeEulerianPathOfThePaper) {
  const Pattern pattern{3, 2, kThree, table_1_path()};
  ASSERT_EQ(pattern.boundaries(), 36);
  const Status status = check_pattern(pattern);
  EXPECT_TRUE(status) << status.error().message;
}

TEST(PatternCheck, NamesTheFirstRepeatedCodeInBaseDigits) {
  Pattern pattern{3, 2, kThree, table_1_path()};
  for (const int vertex : {6, 1, 3}) pattern.sequence.push_back(vertex);  // 00|20 shares nothing to share
  pattern.sequence.resize(37);
  pattern.sequence.insert(pattern.sequence.end(), {5, 6, 1});  // 00|12, which boundary 3 has already
  const Status status = check_pattern(pattern);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, "boundary 36 repeats the code 00|12 of boundary 3");
}

TEST(PatternCheck, WorksForOneSlideAndForThree) {
  EXPECT_TRUE(check_pattern({3, 1, kThree, {0, 1, 2, 0, 2, 1, 0}}));
  const Status repeated = check_pattern({3, 1, kThree, {0, 1, 2, 0, 1}});
  ASSERT_FALSE(repeated);
  EXPECT_EQ(repeated.error().message, "boundary 3 repeats the code 0|1 of boundary 0");
  EXPECT_TRUE(check_pattern({3, 3, kThree, {0, 13, 26, 0, 14}}));  // 000 111 222 000 112
  EXPECT_FALSE(check_pattern({3, 3, kThree, {0, 12}}));            // 000 110: the third slide has no boundary
}

TEST(PatternCheck, OneSlideAloneMayRepeatCodes) {
  EXPECT_TRUE(check_pattern({3, 1, kThree, {0, 1, 2, 0, 1}, Scheme::kOneSlide}));
  EXPECT_FALSE(check_pattern({3, 1, kThree, {0, 1, 2, 0, 1}, Scheme::kWhiteField}));
  EXPECT_FALSE(check_pattern({3, 1, kThree, {0, 1, 1, 0}, Scheme::kOneSlide}));
  const Status two = check_pattern({3, 2, kThree, table_1_path(), Scheme::kOneSlide});
  ASSERT_FALSE(two);
  EXPECT_EQ(two.error().message, "scheme one-slide has slides: 1, not 2");
}

TEST(PatternCheck, RefusesSlidesThatOverflow) {
  EXPECT_FALSE(check_pattern({6, 13, {1, 2, 4, 6, 5, 3}, {0, 1}}));
}

}  // namespace
}  // namespace relievo
