// SPDX-License-Identifier: Apache-2.0
// The boundary code against the paper's own table and against properties checked without the code's
// arithmetic.
#include "capture/pattern/bcsl.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "capture/pattern/clear_path.h"

namespace relievo {
namespace {

using ::testing::HasSubstr;

/// Digits of a vertex by the definition of a number in base b, slide 1's first.
std::vector<int> digits_of(int vertex, int base, int slides) {
  std::vector<int> digits(static_cast<std::size_t>(slides));
  for (auto digit = digits.rbegin(); digit != digits.rend(); ++digit, vertex /= base) *digit = vertex % base;
  return digits;
}

bool differ_on_every_slide(int a, int b, int base, int slides) {
  const auto da = digits_of(a, base, slides), db = digits_of(b, base, slides);
  for (int s = 0; s < slides; ++s) {
    if (da[static_cast<std::size_t>(s)] == db[static_cast<std::size_t>(s)]) return false;
  }
  return true;
}

/// The path that the paper's Table 1 was made from, as base-3 digit pairs.
Pattern paper_pattern() {
  const std::string path =
      "00 11 22 00 12 21 00 21 12 00 22 01 20 12 01 12 20 01 10 01 22 10 02 20 02 21 10 21 02 10 22 11 20 11 "
      "02 "
      "11 00";
  Pattern pattern{3, 2, default_palette(3), {}};
  for (std::size_t i = 0; i < path.size(); i += 3) {
    pattern.sequence.push_back((path[i] - '0') * 3 + path[i + 1] - '0');
  }
  return pattern;
}

TEST(Bcsl, DecodesThePapersTable1EntryByEntry) {
  constexpr int kTable1[9][4] = {
      {0, 3, 6, 9},     {14, 17, 19, 11}, {28, 34, 22, 24},  // V(00) V(01) V(02)
      {26, 29, 18, 21}, {1, 31, 33, 35},  {15, 4, 8, 13},    // V(10) V(11) V(12)
      {16, 23, 32, 12}, {27, 5, 7, 25},   {2, 10, 20, 30},   // V(20) V(21) V(22)
  };
  const auto table = DecodingTable::create(paper_pattern());
  ASSERT_TRUE(table) << table.error().message;
  for (int v = 0; v < 9; ++v) {
    for (int j = 0; j < 4; ++j) {
      EXPECT_EQ(table->entry(v, j), kTable1[v][j]) << "V(" << v / 3 << v % 3 << ") d(" << j << ")";
      EXPECT_EQ(table->boundary(v, table->graph().neighbour(v, j)), kTable1[v][j]);
    }
  }
}

TEST(Bcsl, Code20To01IsThePapersBoundary16) {
  const auto table = DecodingTable::create(paper_pattern());
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->boundary(2 * 3 + 0, 0 * 3 + 1), 16);
  // Figure 3: blue to red on slide 1, red to green on slide 2 (digits 0, 1, 2 are R, G, B).
  constexpr Primary kRed = 0b001, kGreen = 0b010, kBlue = 0b100;
  const std::vector<Primary> left{kBlue, kRed}, right{kRed, kGreen};
  EXPECT_EQ(table->boundary_of_colours(left, right), 16);
}

TEST(Bcsl, Vertex11sNeighbourD2Is02) {  // section 3.2's worked example
  const auto graph = BcslGraph::create(3, 2);
  ASSERT_TRUE(graph);
  EXPECT_EQ(graph->neighbour(1 * 3 + 1, 2), 0 * 3 + 2);
  EXPECT_EQ(graph->neighbour_index(1 * 3 + 1, 0 * 3 + 2), 2);
}

TEST(Bcsl, SixColoursOnTwoSlidesGive900Codes) {
  const auto graph = BcslGraph::create(6, 2);
  ASSERT_TRUE(graph);
  const std::vector<int> path = graph->eulerian_path();
  ASSERT_EQ(path.size(), 901u);
  std::set<std::pair<int, int>> codes;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) codes.insert({path[i], path[i + 1]});
  EXPECT_EQ(codes.size(), 900u);
}

TEST(Bcsl, DefaultPaletteIsThatOfATake) {
  const auto pattern = make_pattern(6, 2, 0, 90);
  ASSERT_TRUE(pattern) << pattern.error().message;
  EXPECT_THAT(to_yaml(*pattern),
              HasSubstr("palette: [ \"100\", \"010\", \"001\", \"011\", \"101\", \"110\" ]"));
}

struct Scheme {
  int base, slides;
};
void PrintTo(const Scheme& scheme, std::ostream* out) {
  *out << scheme.base << "," << scheme.slides;
}

class BcslScheme : public ::testing::TestWithParam<Scheme> {};

TEST_P(BcslScheme, NeighboursAreExactlyTheVerticesThatDifferOnEverySlide) {
  const auto [base, slides] = GetParam();
  const auto graph = BcslGraph::create(base, slides);
  ASSERT_TRUE(graph) << graph.error().message;
  const int step = graph->vertices() > 64 ? 37 : 1;  // every vertex of small graphs, a sample of large ones
  for (int v = 0; v < graph->vertices(); v += step) {
    EXPECT_EQ(graph->vertex(digits_of(v, base, slides)), v);
    std::map<int, int> index_of;
    for (int j = 0; j < graph->degree(); ++j) index_of[graph->neighbour(v, j)] = j;
    ASSERT_EQ(static_cast<int>(index_of.size()), graph->degree());
    for (int w = 0; w < graph->vertices(); ++w) {
      const bool adjacent = differ_on_every_slide(v, w, base, slides);
      ASSERT_EQ(index_of.count(w) == 1, adjacent) << v << " " << w;
      ASSERT_EQ(graph->neighbour_index(v, w), adjacent ? index_of[w] : -1) << v << " " << w;
    }
  }
}

TEST_P(BcslScheme, PathUsesEveryBoundaryCodeOnce) {
  const auto [base, slides] = GetParam();
  const auto graph = BcslGraph::create(base, slides);
  ASSERT_TRUE(graph) << graph.error().message;
  long long codes = 1;  // counted from the definition: an ordered pair of different digits on each slide
  for (int s = 0; s < slides; ++s) codes *= static_cast<long long>(base) * (base - 1);
  const std::vector<int> path = graph->eulerian_path();
  ASSERT_EQ(static_cast<long long>(path.size()), codes + 1);
  EXPECT_EQ(path.front(), 0);
  EXPECT_EQ(path.back(), 0);
  std::set<std::pair<int, int>> seen;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    ASSERT_TRUE(differ_on_every_slide(path[i], path[i + 1], base, slides)) << "boundary " << i;
    ASSERT_TRUE(seen.insert({path[i], path[i + 1]}).second) << "boundary " << i << " repeats";
  }
  EXPECT_EQ(path, graph->eulerian_path());
}

TEST_P(BcslScheme, SubPathsDecodeToThemselvesAndNothingElseDecodes) {
  const auto [base, slides] = GetParam();
  const auto graph = BcslGraph::create(base, slides);
  ASSERT_TRUE(graph) << graph.error().message;
  const std::vector<int> path = graph->eulerian_path();
  const int length = std::min<int>(91, static_cast<int>(path.size()));
  for (const int first :
       {0, (static_cast<int>(path.size()) - length) / 2, static_cast<int>(path.size()) - length}) {
    const Pattern pattern{base, slides, {}, {path.begin() + first, path.begin() + first + length}};
    const auto table = DecodingTable::create(pattern);
    ASSERT_TRUE(table) << table.error().message;
    for (int i = 0; i < static_cast<int>(path.size()) - 1; ++i) {
      const bool projected = i >= first && i < first + length - 1;
      const auto at = static_cast<std::size_t>(i);
      ASSERT_EQ(table->boundary(path[at], path[at + 1]), projected ? i - first : -1);
    }
    EXPECT_EQ(table->boundary(0, 0), -1);
  }
}

std::vector<Scheme> schemes() {
  std::vector<Scheme> all;
  for (int base = 3; base <= 8; ++base) {
    for (int slides = 1; slides <= 3; ++slides) all.push_back({base, slides});
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(All, BcslScheme, ::testing::ValuesIn(schemes()), [](const auto& scheme) {
  return "b" + std::to_string(scheme.param.base) + "s" + std::to_string(scheme.param.slides);
});

TEST(Bcsl, ColoursDecodeAsTheirVerticesDo) {
  for (int base = 3; base <= 6; ++base) {
    const auto pattern = make_pattern(base, 2, 3, 30);
    ASSERT_TRUE(pattern) << pattern.error().message;
    const auto table = DecodingTable::create(*pattern);
    ASSERT_TRUE(table) << table.error().message;
    const int vertices = base * base;
    for (int l = 0; l < vertices; ++l) {
      for (int r = 0; r < vertices; ++r) {
        const auto dl = digits_of(l, base, 2), dr = digits_of(r, base, 2);
        std::vector<Primary> left, right;
        for (std::size_t s = 0; s < 2; ++s) {
          left.push_back(pattern->palette[static_cast<std::size_t>(dl[s])]);
          right.push_back(pattern->palette[static_cast<std::size_t>(dr[s])]);
        }
        EXPECT_EQ(table->boundary_of_colours(left, right), table->boundary(l, r));
      }
    }
    for (int i = 0; i < pattern->boundaries(); ++i) {
      const std::vector<Primary> left{pattern->colour(i, 0), pattern->colour(i, 1)};
      const std::vector<Primary> right{pattern->colour(i + 1, 0), pattern->colour(i + 1, 1)};
      EXPECT_EQ(table->boundary_of_colours(left, right), i);
    }
  }
}

TEST(Bcsl, ColoursOutsideThePaletteDoNotDecode) {
  const auto table = DecodingTable::create(paper_pattern());
  ASSERT_TRUE(table);
  for (const Primary other : {Primary{0}, Primary{3}, Primary{5}, Primary{6}, Primary{7}}) {
    const std::vector<Primary> left{1, 1}, right{2, other};
    EXPECT_EQ(table->boundary_of_colours(left, right), -1) << int{other};
    EXPECT_EQ(table->boundary_of_colours(right, left), -1) << int{other};
  }
}

TEST(ClearPath, ItsBoundariesFlipAsManyChannelsAsItsLengthAllows) {
  const auto graph = BcslGraph::create(6, 2);
  ASSERT_TRUE(graph);
  const std::vector<Primary> palette = default_palette(6);
  // Of 900 codes 468 flip 4 and more: of 25 pairs of steps (2 + 2 + 1 a slide flip 1, 2 and 3 channels) 13,
  // from 36 stripes each.
  for (const auto& [stripes, length, flips] :
       {std::tuple{2, 469, 4}, {469, 469, 4}, {470, 757, 3}, {758, 901, 2}, {901, 901, 2}}) {
    const std::vector<int> path = clear_path(*graph, palette, stripes);
    ASSERT_EQ(static_cast<int>(path.size()), length) << stripes;
    EXPECT_EQ(path.front(), 0);
    std::set<std::pair<int, int>> codes;
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
      ASSERT_TRUE(codes.insert({path[i], path[i + 1]}).second) << "boundary " << i << " repeats";
      int flipped = 0;
      for (int s = 0; s < 2; ++s) {
        const auto primary = [&](int vertex) {
          return palette[static_cast<std::size_t>(graph->digit(vertex, s))];
        };
        ASSERT_NE(primary(path[i]), primary(path[i + 1])) << "boundary " << i << " keeps its colour";
        flipped += std::popcount(static_cast<unsigned>(primary(path[i]) ^ primary(path[i + 1])));
      }
      EXPECT_GE(flipped, flips) << "boundary " << i;
    }
  }
}

TEST(ClearPath, OfAnyCodeEachBoundaryComesOnce) {
  for (int base = 3; base <= 6; ++base) {
    for (int slides = 1; slides <= 3; ++slides) {
      const auto graph = BcslGraph::create(base, slides);
      ASSERT_TRUE(graph);
      const std::vector<int> path = clear_path(*graph, default_palette(base), graph->arcs() + 1);
      ASSERT_EQ(static_cast<int>(path.size()), graph->arcs() + 1);
      EXPECT_TRUE(DecodingTable::create({base, slides, default_palette(base), path}))
          << base << "," << slides;
    }
  }
}

TEST(ClearPath, ThePapersOwnIsThereForTheAsking) {
  const auto graph = BcslGraph::create(6, 2);
  const auto pattern = make_pattern(6, 2, 40, 90, CodePath::kPaper);
  ASSERT_TRUE(graph && pattern);
  const std::vector<int> path = graph->eulerian_path();
  EXPECT_EQ(pattern->sequence, std::vector<int>(path.begin() + 40, path.begin() + 130));
  EXPECT_NE(make_pattern(6, 2, 40, 90)->sequence, pattern->sequence);
}

TEST(BcslRefusals, SchemesThatDoNotExistOrDoNotFit) {
  EXPECT_THAT(BcslGraph::create(2, 2).error().message, HasSubstr("at least 3 colours, not 2"));
  EXPECT_THAT(BcslGraph::create(-7, 2).error().message, HasSubstr("at least 3 colours"));
  EXPECT_THAT(BcslGraph::create(6, 0).error().message, HasSubstr("at least 1 slide, not 0"));
  EXPECT_THAT(BcslGraph::create(6, 6).error().message, HasSubstr("too many to hold"));
  EXPECT_THAT(BcslGraph::create(2'000'000'000, 1).error().message, HasSubstr("too many to hold"));
  EXPECT_THAT(BcslGraph::create(3, 2'000'000'000).error().message, HasSubstr("too many to hold"));
  EXPECT_TRUE(BcslGraph::create(6, 5));
}

TEST(BcslRefusals, SubPathsOutOfRange) {
  EXPECT_TRUE(make_pattern(3, 2, 0, 37));
  EXPECT_TRUE(make_pattern(3, 2, 35, 2));
  EXPECT_THAT(make_pattern(3, 2, 0, 38).error().message, HasSubstr("path has stripes 0 to 36"));
  for (const int first : {-1, 36, 37, 1'000'000, 2'147'483'647}) {
    EXPECT_THAT(make_pattern(3, 2, first, 2).error().message, HasSubstr("do not fit")) << first;
  }
  EXPECT_THAT(make_pattern(3, 2, 5, 2'147'483'647).error().message, HasSubstr("do not fit"));
  EXPECT_THAT(make_pattern(6, 2, 0, 1).error().message, HasSubstr("at least 2 stripes"));
  EXPECT_THAT(make_pattern(7, 2, 0, 90).error().message, HasSubstr("no palette of 7 colours"));
}

TEST(BcslRefusals, SequencesThatAreNoPath) {
  Pattern pattern = paper_pattern();
  pattern.sequence.push_back(pattern.sequence[1]);  // 00|11 again
  EXPECT_THAT(DecodingTable::create(pattern).error().message,
              HasSubstr("boundary 36 repeats the code 00|11 of boundary 0"));
  pattern.sequence = {0, 4, 3};  // 11|10 keeps slide 1's colour
  EXPECT_THAT(DecodingTable::create(pattern).error().message,
              HasSubstr("boundary 1 (11|10) keeps its colour"));
  pattern.sequence = {0, 9};
  EXPECT_THAT(DecodingTable::create(pattern).error().message, HasSubstr("stripe 1 is 9"));
}

}  // namespace
}  // namespace relievo
