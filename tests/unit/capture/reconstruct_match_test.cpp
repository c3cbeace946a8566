// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/match.h"

#include <gtest/gtest.h>

#include <array>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

Pattern thirty_stripes() {
  return *make_pattern(6, 2, 200, 30);
}

/// Boundary `index` of `pattern` as seen under `slide` at `column`.
Boundary seen(const Pattern& pattern, int index, int slide, float column) {
  return {column, 10, pattern.colour(index, slide), pattern.colour(index + 1, slide)};
}

Detection detection(const std::vector<std::vector<Boundary>>& lines) {
  Detection out;
  out.width = 100;
  out.lines = static_cast<int>(lines.size());
  out.line_start = {0};
  for (const auto& line : lines) {
    out.boundaries.insert(out.boundaries.end(), line.begin(), line.end());
    out.line_start.push_back(static_cast<std::uint32_t>(out.boundaries.size()));
  }
  return out;
}

/// What one boundary of pattern index 4 at column 50 of line 10 (under slide 1) decodes to when the frame
/// before, under slide 2, shows `older` (line, boundary).
int decoded(const std::vector<std::pair<int, Boundary>>& older) {
  const Pattern pattern = thirty_stripes();
  std::vector<std::vector<Boundary>> newer_lines(20), older_lines(20);
  newer_lines[10] = {seen(pattern, 4, 0, 50)};
  for (const auto& [line, boundary] : older) older_lines[static_cast<std::size_t>(line)].push_back(boundary);
  Match match;
  match_boundaries(detection(newer_lines), detection(older_lines), SlideOrder::kNewerIsFirst,
                   TransitionTable(pattern), match);
  EXPECT_EQ(match.boundary.size(), 1U);
  EXPECT_EQ(match.valid, match.boundary[0] >= 0 ? 1U : 0U);
  return match.boundary[0];
}

Boundary under_slide_2(int index, float column) {
  return seen(thirty_stripes(), index, 1, column);
}

TEST(TransitionTable, AgreesWithTheDecodingTableForEveryPairOfColours) {
  for (const int slides : {1, 2}) {
    const Pattern pattern = *make_pattern(6, slides, slides == 1 ? 2 : 100, slides == 1 ? 20 : 400);
    const auto golden = DecodingTable::create(pattern);
    ASSERT_TRUE(golden) << golden.error().message;
    const TransitionTable table(pattern);
    EXPECT_EQ(table.slides(), slides);
    int codes = 0;
    for (int code = 0; code < 8 * 8 * 8 * 8; ++code) {
      const std::array<Primary, 2> left{static_cast<Primary>(code & 7), static_cast<Primary>(code >> 6 & 7)};
      const std::array<Primary, 2> right{static_cast<Primary>(code >> 3 & 7),
                                         static_cast<Primary>(code >> 9 & 7)};
      const auto count = static_cast<std::size_t>(slides);
      const int expected =
          golden->boundary_of_colours(std::span(left).first(count), std::span(right).first(count));
      ASSERT_EQ(table.boundary(left[0], right[0], left[1], right[1]), expected)
          << int{left[0]} << int{right[0]} << " " << int{left[1]} << int{right[1]};
      codes += expected >= 0;
    }
    EXPECT_EQ(codes, pattern.boundaries() * (slides == 1 ? 64 : 1));
  }
}

TEST(Match, EveryBoundaryInPlaceDecodesInBothOrders) {
  const Pattern pattern = thirty_stripes();
  const TransitionTable table(pattern);
  std::vector<std::vector<Boundary>> first(4), second(4);
  for (std::size_t line = 0; line < 4; ++line) {
    for (int i = 0; i < pattern.boundaries(); ++i) {
      const float column = 10 + 8 * static_cast<float>(i);
      first[line].push_back(seen(pattern, i, 0, column));
      second[line].push_back(seen(pattern, i, 1, column + 0.4F));
    }
  }
  const Detection slide_1 = detection(first);
  const Detection slide_2 = detection(second);
  Match match;
  match.boundary.assign(3, 77);  // whatever an earlier frame left
  match.valid = 99;
  for (const bool newer_is_first : {true, false}) {
    match_boundaries(newer_is_first ? slide_1 : slide_2, newer_is_first ? slide_2 : slide_1,
                     newer_is_first ? SlideOrder::kNewerIsFirst : SlideOrder::kNewerIsSecond, table, match);
    const auto count = static_cast<std::size_t>(pattern.boundaries());
    ASSERT_EQ(match.boundary.size(), 4 * count);
    EXPECT_EQ(match.valid, 4 * count);
    for (std::size_t i = 0; i < match.boundary.size(); ++i)
      EXPECT_EQ(match.boundary[i], static_cast<int>(i % count));
  }
}

TEST(Match, TheWrongOrderDecodesDifferently) {
  const Pattern pattern = thirty_stripes();
  const Detection first = detection({{seen(pattern, 4, 0, 50)}});
  const Detection second = detection({{seen(pattern, 4, 1, 50)}});
  const TransitionTable table(pattern);
  Match match;
  match_boundaries(first, second, SlideOrder::kNewerIsSecond, table, match);
  EXPECT_NE(match.boundary.at(0), 4);
}

/// Colours that make no code of the pattern with boundary 4 under slide 1.
Boundary invalid(float column) {
  const Pattern pattern = thirty_stripes();
  const TransitionTable table(pattern);
  for (Primary left = 1; left <= 6; ++left) {
    for (Primary right = 1; right <= 6; ++right) {
      if (left != right && table.boundary(pattern.colour(4, 0), pattern.colour(5, 0), left, right) < 0)
        return {column, 10, left, right};
    }
  }
  ADD_FAILURE() << "every pair of colours is a code";
  return {};
}

TEST(Match, NearestValidOneWins) {
  EXPECT_EQ(decoded({{10, under_slide_2(4, 51)}}), 4);
  EXPECT_EQ(decoded({{10, invalid(50)}, {10, under_slide_2(4, 51)}}), 4);
  EXPECT_EQ(decoded({{9, invalid(50)}, {10, invalid(50)}, {12, under_slide_2(4, 48)}}), 4);
  EXPECT_EQ(decoded({{10, invalid(50)}}), -1);
}

TEST(Match, OfTwoValidOnesTheNearerWins) {
  // Another boundary with the same colours under slide 1 as boundary `a`, so that both decode.
  const Pattern pattern = *make_pattern(6, 2, 0, 400);
  int a = -1;
  int b = -1;
  for (int i = 0; i < pattern.boundaries() && a < 0; ++i) {
    for (int k = i + 1; k < pattern.boundaries(); ++k) {
      if (pattern.colour(i, 0) == pattern.colour(k, 0) &&
          pattern.colour(i + 1, 0) == pattern.colour(k + 1, 0)) {
        a = i;
        b = k;
        break;
      }
    }
  }
  ASSERT_GE(a, 0);
  const TransitionTable table(pattern);
  std::vector<std::vector<Boundary>> newer(7);
  newer[3] = {seen(pattern, a, 0, 50)};
  const auto decode = [&](int near_line, float near_column, int far_line, float far_column) {
    std::vector<std::vector<Boundary>> older(7);
    older[static_cast<std::size_t>(near_line)].push_back(seen(pattern, a, 1, near_column));
    older[static_cast<std::size_t>(far_line)].push_back(seen(pattern, b, 1, far_column));
    for (auto& line : older)
      std::sort(line.begin(), line.end(),
                [](const Boundary& p, const Boundary& q) { return p.column_px < q.column_px; });
    Match match;
    match_boundaries(detection(newer), detection(older), SlideOrder::kNewerIsFirst, table, match);
    return int{match.boundary.at(0)};
  };
  EXPECT_EQ(decode(3, 51, 3, 52), a);
  EXPECT_EQ(decode(3, 52.5F, 3, 48), b);
  EXPECT_EQ(decode(4, 50, 3, 51.5F), a);  // distance is across lines too
  EXPECT_EQ(decode(5, 50, 3, 51.5F), b);  // two lines are further than one and a half columns
  EXPECT_EQ(decode(1, 50.5F, 6, 50), a);
  EXPECT_EQ(decode(6, 50, 4, 51), b);
}

TEST(Match, SevenBySevenAndNoFurther) {
  EXPECT_EQ(decoded({{10, under_slide_2(4, 53)}}), 4);
  EXPECT_EQ(decoded({{10, under_slide_2(4, 47)}}), 4);
  EXPECT_EQ(decoded({{10, under_slide_2(4, 53.01F)}}), -1);
  EXPECT_EQ(decoded({{10, under_slide_2(4, 46.99F)}}), -1);
  EXPECT_EQ(decoded({{13, under_slide_2(4, 50)}}), 4);
  EXPECT_EQ(decoded({{7, under_slide_2(4, 50)}}), 4);
  EXPECT_EQ(decoded({{14, under_slide_2(4, 50)}}), -1);
  EXPECT_EQ(decoded({{6, under_slide_2(4, 50)}}), -1);
  EXPECT_EQ(decoded({{13, under_slide_2(4, 53)}}), 4);  // the corner
}

TEST(Match, AtTheFirstAndLastLineAndInEmptyFrames) {
  const Pattern pattern = thirty_stripes();
  const TransitionTable table(pattern);
  Match match;
  for (const int line : {0, 4}) {
    std::vector<std::vector<Boundary>> newer(5), older(5);
    newer[static_cast<std::size_t>(line)] = {seen(pattern, 9, 0, 50)};
    older[static_cast<std::size_t>(line == 0 ? 2 : 2)] = {seen(pattern, 9, 1, 50)};
    match_boundaries(detection(newer), detection(older), SlideOrder::kNewerIsFirst, table, match);
    EXPECT_EQ(match.boundary.at(0), 9) << "line " << line;
  }
  const Detection none = detection(std::vector<std::vector<Boundary>>(5));
  std::vector<std::vector<Boundary>> some(5);
  some[2] = {seen(pattern, 9, 0, 50)};
  match_boundaries(detection(some), none, SlideOrder::kNewerIsFirst, table, match);
  EXPECT_EQ(match.boundary, std::vector<std::int16_t>{-1});
  EXPECT_EQ(match.valid, 0U);
  match_boundaries(none, detection(some), SlideOrder::kNewerIsFirst, table, match);
  EXPECT_TRUE(match.boundary.empty());
  match_boundaries(detection({}), detection({}), SlideOrder::kNewerIsFirst, table, match);
  EXPECT_TRUE(match.boundary.empty());
}

TEST(Match, OneSlideDecodesByItself) {
  const Pattern pattern = *make_pattern(6, 1, 0, 12);
  const TransitionTable table(pattern);
  std::vector<Boundary> line;
  for (int i = 0; i < pattern.boundaries(); ++i)
    line.push_back(seen(pattern, i, 0, 8 * static_cast<float>(i)));
  const Primary left = line[0].left;
  line.push_back({90, 10, left, static_cast<Primary>(left == 7 ? 1 : 7)});  // white is in no pattern
  Match match;
  decode_single_slide(detection({line}), table, match);
  ASSERT_EQ(match.boundary.size(), 12U);
  for (int i = 0; i < 11; ++i) EXPECT_EQ(match.boundary[static_cast<std::size_t>(i)], i);
  EXPECT_EQ(match.boundary[11], -1);
  EXPECT_EQ(match.valid, 11U);
}

}  // namespace
}  // namespace relievo
