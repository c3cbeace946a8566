// SPDX-License-Identifier: Apache-2.0
// What each scheme projects and at which rates, and the repeating sequences of one-slide.
#include "capture/pattern/schedule.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "capture/pattern/bcsl.h"
#include "capture/pattern/pattern_check.h"
#include "capture/pattern/repeating.h"
#include "capture/pattern/slides.h"

namespace relievo {
namespace {

constexpr double kNtsc = 29.97;

Pattern two_slides(Scheme scheme) {
  Pattern pattern = *make_pattern(6, 2, 0, 40);
  pattern.scheme = scheme;
  return pattern;
}

std::vector<Exposure> fields(const Pattern& pattern, int frames) {
  std::vector<Exposure> out;
  for (int f = 0; f < frames; ++f)
    for (const int half : {0, 1}) out.push_back(shown(pattern, static_cast<std::uint64_t>(f), half));
  return out;
}

TEST(Schedule, EachSchemeShowsWhatSection55Says) {
  const Exposure s1{Light::kSlide, 0}, s2{Light::kSlide, 1};
  const Exposure c1{Light::kComplement, 0}, c2{Light::kComplement, 1};
  const Exposure w{Light::kWhite, 0}, w2{Light::kWhite, 1};
  using F = std::vector<Exposure>;
  EXPECT_EQ(fields(two_slides(Scheme::kComplementary), 3), (F{s1, c1, s2, c2, s1, c1}));
  EXPECT_EQ(fields(two_slides(Scheme::kWhiteField), 3), (F{s1, w, s2, w2, s1, w}));
  EXPECT_EQ(fields(two_slides(Scheme::kWhiteFrame), 4), (F{s1, c1, s2, c2, w, w, s1, c1}));
  EXPECT_EQ(fields(*make_repeating_pattern(6, 0, 90), 2), (F{s1, c1, s1, c1}));
}

TEST(Schedule, RatesArePapersAtNtsc) {
  const auto rates = [](const Pattern& p) {
    return std::pair(texture_rate(p, kNtsc), geometry_rate(p, kNtsc));
  };
  EXPECT_EQ(rates(two_slides(Scheme::kComplementary)), std::pair(kNtsc, kNtsc));
  EXPECT_EQ(rates(two_slides(Scheme::kWhiteField)), std::pair(kNtsc, 2 * kNtsc));
  const auto [texture, geometry] = rates(two_slides(Scheme::kWhiteFrame));
  EXPECT_NEAR(texture, kNtsc / 3, 1e-9);
  EXPECT_NEAR(geometry, kNtsc * 2 / 3, 1e-9);
  EXPECT_EQ(rates(*make_repeating_pattern(6, 0, 90)), std::pair(kNtsc, kNtsc));
}

TEST(Schedule, WhiteIsWhiteOnItsOwnRows) {
  const Pattern pattern = two_slides(Scheme::kWhiteField);
  const Image8 slide = draw_slide(pattern, 1, false, 200, 1);
  const Image8 frame = draw_interlaced(pattern, 1, FieldOrder::kBottom, 200, 4);
  for (int i = 0; i < 600; ++i) {
    ASSERT_EQ(frame.row(0)[i], 255);
    ASSERT_EQ(frame.row(3)[i], slide.row(0)[i]);
  }
}

TEST(Repeating, NoRunComesTwice) {
  for (const int base : {3, 4, 5, 6}) {
    for (const int stripes : {2, 7, 31, 32, 90, 151, 152, 400}) {
      const auto pattern = make_repeating_pattern(base, 0, stripes);
      if (!pattern) {  // a small base has no more runs
        EXPECT_EQ(base, 3) << stripes;
        continue;
      }
      EXPECT_EQ(pattern->stripes(), stripes);
      const Status valid = check_pattern(*pattern);
      EXPECT_TRUE(valid) << valid.error().message;
      const int codes = base * (base - 1);
      const int boundaries = pattern->boundaries();
      const int least = boundaries <= codes ? 1 : boundaries <= codes * (base - 1) ? 2 : 3;
      if (least < 3)
        EXPECT_LE(unique_run(*pattern), least) << base << " " << stripes;
      else
        EXPECT_LE(unique_run(*pattern), 6) << base << " " << stripes;
    }
  }
}

TEST(Repeating, KnowsHowLongRunsMustBe) {
  Pattern pattern{3, 1, default_palette(3), {0, 1, 2, 0, 1, 0}, Scheme::kOneSlide};
  EXPECT_EQ(unique_run(pattern), 2);  // 01 comes twice, 012 and 010 once
  pattern.sequence = {0, 1, 2, 0, 1, 2, 0};
  EXPECT_EQ(unique_run(pattern), 4);
  pattern.sequence = {0, 1, 2};
  EXPECT_EQ(unique_run(pattern), 1);
}

TEST(Repeating, RefusesByName) {
  EXPECT_FALSE(make_repeating_pattern(2, 0, 10));
  EXPECT_FALSE(make_repeating_pattern(7, 0, 10));
  EXPECT_FALSE(make_repeating_pattern(6, -1, 10));
  EXPECT_FALSE(make_repeating_pattern(6, 0, 1));
  const auto many = make_repeating_pattern(3, 0, 1000);
  ASSERT_FALSE(many);
  EXPECT_EQ(many.error().message,
            "1000 stripes from stripe 0 are too many for one slide of base 3: at most 193");
}

}  // namespace
}  // namespace relievo
