// SPDX-License-Identifier: Apache-2.0
// Luma's kernels: the portable ones against their definition, and every other set of instructions that this
// machine has against the portable ones; and a line read as a whole against places looked at one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "capture/reconstruct/luma_place.h"
#include "capture/reconstruct/luma_rows.h"

namespace relievo {
namespace {

constexpr int kMargin = 8;
constexpr std::array<float, 3> kWeights{0.3F, 0.6F, 0.1F};

std::vector<float> random_row(std::mt19937& random, int width, float least, float most) {
  std::uniform_real_distribution<float> any(least, most);
  std::bernoulli_distribution extreme(0.1);
  std::vector<float> out(static_cast<std::size_t>(width + 2 * kMargin));
  for (float& v : out) v = extreme(random) ? least : any(random);
  return out;
}

class LumaRows : public testing::TestWithParam<std::size_t> {
 protected:
  const LumaKernels& kernels() const { return all_luma_kernels()[GetParam()]; }
  std::mt19937 random{3};
};

TEST_P(LumaRows, Ratios) {
  for (const int width : {1, 7, 8, 16, 33, 640}) {
    const auto red = random_row(random, width, -255, 255), green = random_row(random, width, -255, 255),
               blue = random_row(random, width, -255, 255), white = random_row(random, width, 0, 510);
    std::array<std::vector<float>, 4> out;
    for (auto& row : out) row.resize(red.size());
    kernels().ratios({red.data(), green.data(), blue.data(), white.data()}, width, kWeights, 3,
                     {out[0].data(), out[1].data(), out[2].data(), out[3].data()});
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); ++x) {
      const float unit = 1 / (white[x] + 3);
      const std::array rgb{red[x] * unit, green[x] * unit, blue[x] * unit};
      for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(out[c][x], rgb[c]);
      ASSERT_EQ(out[3][x], kWeights[0] * rgb[0] + kWeights[1] * rgb[1] + kWeights[2] * rgb[2]);
    }
  }
}

TEST_P(LumaRows, Ends) {
  for (const int width : {1, 7, 8, 31, 640}) {
    const auto row = random_row(random, width, 0, 510);
    const float* white = row.data() + kMargin;
    std::vector<std::uint8_t> ends(static_cast<std::size_t>(width));
    kernels().ends(white, width, 0.12F, 3, ends.data());
    for (int x = 0; x < width; ++x) {
      const bool end = std::fabs(white[x + 1] - white[x - 1]) > 0.12F * (white[x + 1] + white[x - 1] + 3);
      ASSERT_EQ(ends[static_cast<std::size_t>(x)], end);
    }
  }
}

TEST_P(LumaRows, ContrastsAreThoseOfEachColumnByItself) {
  for (const int width : {16, 40, 641}) {
    DifferenceImage image;
    image.width = width;
    image.lines = 5;
    image.white.resize(static_cast<std::size_t>(5 * width));
    std::uniform_real_distribution<float> any(0, 510);
    for (float& w : image.white) w = any(random);
    for (const bool wide : {false, true}) {
      for (int line = 0; line < image.lines; ++line) {
        const float* here = image.white_line(line);
        const WhiteRows rows{image.white_line(std::max(0, line - 1)) + 1, here + 1,
                             image.white_line(std::min(4, line + 1)) + 1};
        std::vector<float> brightest(static_cast<std::size_t>(width)), darkest(brightest), out(brightest);
        kernels().extremes(rows, width - 2, wide, brightest.data() + 1, darkest.data() + 1);
        for (const int around : {kContrastReach_px, kLumaContrast_px}) {
          const int first = around + 1;
          kernels().contrasts(brightest.data() + first, darkest.data() + first, width - 2 * first, around, 3,
                              out.data() + first);
          for (int x = first; x < width - first; ++x) {
            float most = 0, least = 1e9F;
            for (const float* row : {rows.above - 1, rows.here - 1, rows.below - 1}) {
              for (int i = x - around; i <= x + around; ++i) {
                most = std::max(most, row[i]);
                least = std::min(least, wide ? std::max({row[i - 1], row[i], row[i + 1]}) : row[i]);
              }
            }
            ASSERT_EQ(out[static_cast<std::size_t>(x)], (most - least) / (most + least + 3)) << x;
            ASSERT_EQ(contrast_around(image, line, x, around, wide), (most - least) / (most + least + 3));
          }
        }
      }
    }
  }
}

/// Stripes of random widths on a surface of random brightness with steps, one line, noisy.
DifferenceImage random_stripes(std::mt19937& random, int width) {
  DifferenceImage out;
  out.width = width;
  out.lines = 1;
  out.noise = 1;
  out.values.resize(static_cast<std::size_t>(3 * width));
  out.white.resize(static_cast<std::size_t>(width));
  std::uniform_int_distribution<int> colour(1, 6), stripe(3, 9);
  std::uniform_real_distribution<float> bright(40, 400);
  std::bernoulli_distribution step(0.2);
  std::normal_distribution<float> noise(0, 1);
  float white = bright(random);
  int left = 0, now = 0;
  for (int x = 0; x < width; ++x, --left) {
    if (left <= 0) {
      left = stripe(random);
      now = colour(random);
      if (step(random)) white = bright(random);
    }
    out.white[static_cast<std::size_t>(x)] = white;
    for (int c = 0; c < 3; ++c)
      out.values[static_cast<std::size_t>(c * width + x)] =
          0.8F * white * (now >> c & 1 ? 1.F : -1.F) + 3 * noise(random);
  }
  return out;
}

/// Boundaries all along a line, whatever they are.
std::vector<LumaQuery> random_queries(std::mt19937& random, int width) {
  std::uniform_int_distribution<int> colour(1, 6);
  std::uniform_real_distribution<float> free(2, 12);
  std::bernoulli_distribution narrow;
  std::vector<LumaQuery> out;
  for (float own = kLumaReach_px; own + kLumaReach_px + 1 <= static_cast<float>(width); own += 0.37F)
    out.push_back({own,
                   {free(random),
                    free(random),
                    {static_cast<Primary>(colour(random)), static_cast<Primary>(colour(random))},
                    narrow(random)}});
  return out;
}

void expect_equal(const LumaPlace& a, const LumaPlace& b, float own_px) {
  ASSERT_EQ(a.found, b.found) << own_px;
  ASSERT_EQ(a.column_px, b.column_px) << own_px;
  ASSERT_EQ(a.slope, b.slope) << own_px;
  ASSERT_EQ(a.rise, b.rise) << own_px;
}

TEST_P(LumaRows, PlacesEqualTheReferences) {
  const LumaPlacer placer({1, 0, 0, 0, 1, 0, 0, 0, 1});
  int found = 0;
  for (const int width : {16, 17, 40, 200}) {
    for (int round = 0; round < 50; ++round) {
      const DifferenceImage image = random_stripes(random, width);
      LumaLine line;
      placer.read_line(image, 0, false, line);
      const std::vector<LumaQuery> queries = random_queries(random, width);
      std::vector<LumaPlace> places(queries.size()), expected(queries.size());
      const LumaLight light{placer.weights(), 0.8F};
      const int count = static_cast<int>(queries.size());
      kernels().places(line.view(), light, queries.data(), count, places.data());
      all_luma_kernels().front().places(line.view(), light, queries.data(), count, expected.data());
      for (std::size_t i = 0; i < queries.size(); ++i) {
        expect_equal(places[i], expected[i], queries[i].own_px);
        found += places[i].found;
      }
    }
  }
  EXPECT_GT(found, 1000);
}

INSTANTIATE_TEST_SUITE_P(, LumaRows, testing::Range(std::size_t{0}, all_luma_kernels().size()),
                         [](const auto& test) { return std::string(all_luma_kernels()[test.param].name); });

TEST(LumaPlacer, ALineReadAsAWholeTellsTheSamePlaces) {
  std::mt19937 random(11);
  const LumaPlacer placer({1, 0, 0, 0, 1, 0, 0, 0, 1});
  int found = 0;
  for (const int width : {16, 17, 40, 200}) {
    for (int round = 0; round < 20; ++round) {
      const DifferenceImage image = random_stripes(random, width);
      LumaLine line;
      placer.read_line(image, 0, false, line);
      const std::vector<LumaQuery> queries = random_queries(random, width);
      std::vector<LumaPlace> places(queries.size());
      placer.places(line, 0.8F, queries.data(), queries.size(), places.data());
      for (std::size_t i = 0; i < queries.size(); ++i) {
        expect_equal(places[i], placer.place(image, 0, 0.8F, queries[i]), queries[i].own_px);
        found += places[i].found;
      }
    }
  }
  EXPECT_GT(found, 1000);
}

TEST(LumaPlacer, AWindowTellsTheSamePlaces) {
  std::mt19937 random(12);
  const LumaPlacer placer({1, 0, 0, 0, 1, 0, 0, 0, 1});
  int found = 0;
  for (const int width : {16, 17, 40, 200}) {
    for (int round = 0; round < 20; ++round) {
      const DifferenceImage image = random_stripes(random, width);
      for (const LumaQuery& query : random_queries(random, width)) {
        const int first = LumaPlacer::first_around(query.own_px, width);
        LumaWindow window;
        std::copy_n(image.line(0) + first, window.red.size(), window.red.begin());
        std::copy_n(image.line(0) + width + first, window.green.size(), window.green.begin());
        std::copy_n(image.line(0) + 2 * width + first, window.blue.size(), window.blue.begin());
        window.white.fill(std::numeric_limits<float>::quiet_NaN());
        for (int x = std::max(0, first - 1); x < std::min(width, first + LumaWindow::kColumns + 1); ++x)
          window.white[static_cast<std::size_t>(x - first + 1)] = image.white_line(0)[x];
        const LumaPlace place = placer.place(window, first, width, 0.8F, query);
        expect_equal(place, placer.place(image, 0, 0.8F, query), query.own_px);
        found += place.found;
      }
    }
  }
  EXPECT_GT(found, 1000);
}

/// A step of luma between two known colours is found where it is, whatever the surface's brightness does.
TEST(LumaPlacer, FindsAStep) {
  constexpr int kWidth = 32;
  const LumaPlacer placer({1, 0, 0, 0, 1, 0, 0, 0, 1});
  const float kBlur = 0.8F * std::sqrt(2.F);
  for (const float place : {14.F, 14.25F, 15.5F, 16.8F}) {
    DifferenceImage image;
    image.width = kWidth;
    image.lines = 1;
    image.values.assign(3 * kWidth, 0);
    image.white.assign(kWidth, 0);
    for (int x = 0; x < kWidth; ++x) {
      const float white = 100 + static_cast<float>(x);
      image.white[static_cast<std::size_t>(x)] = white;
      // Red to yellow: green rises from -1 to 1, blurred as by a lens, a pixel and the low-pass along lines.
      const float green = std::erf((static_cast<float>(x) - place) / kBlur);
      const std::array<float, 3> rgb{1, green, -1};
      for (std::size_t c = 0; c < 3; ++c)
        image.values[c * kWidth + static_cast<std::size_t>(x)] = rgb[c] * (white + kDarkSum);
    }
    const LumaPlace found = placer.place(image, 0, 1, {15.2F, {9, 9, {1, 3}}});
    ASSERT_TRUE(found.found);
    const float before = std::floor(place);
    const float step = std::erf((before + 1 - place) / kBlur) - std::erf((before - place) / kBlur);
    EXPECT_NEAR(found.column_px, place, 8e-3);
    EXPECT_NEAR(found.slope, 0.587F * step, 1e-3);
    EXPECT_NEAR(found.rise, 2 * 0.587, 1e-2);
  }
}

}  // namespace
}  // namespace relievo
