// SPDX-License-Identifier: Apache-2.0
// The quick decoder's kernels: the portable ones against their definition, and every other set of
// instructions that this machine has against the portable ones, on random and extreme rows of any width.
#include "capture/reconstruct/quick_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

namespace relievo {
namespace {

constexpr std::array kWidths{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 16, 17, 31, 64, 65, 101, 640, 643};

class QuickRows : public testing::TestWithParam<std::size_t> {
 protected:
  const QuickKernels& kernels() const { return all_quick_kernels()[GetParam()]; }
  const QuickKernels& reference() const { return all_quick_kernels().front(); }

  /// Every third row has nothing but the two extremes.
  std::vector<std::int16_t> row(int count, int least, int most) {
    const bool extremes = ++made_ % 3 == 0;
    std::uniform_int_distribution<int> any(least, most);
    std::bernoulli_distribution coin;
    std::vector<std::int16_t> out(static_cast<std::size_t>(count));
    for (auto& v : out)
      v = static_cast<std::int16_t>(!extremes ? any(random_) : coin(random_) ? most : least);
    return out;
  }
  /// As to_quads makes them, smooth over `period` columns so that there are crossings of some length.
  std::vector<std::int16_t> quads(int width, double period) {
    std::uniform_real_distribution<double> phase(0, 6.28);
    std::array<double, 3> begin{phase(random_), phase(random_), phase(random_)};
    std::uniform_int_distribution<int> noise(-20, 20);
    std::vector<std::int16_t> out(4 * static_cast<std::size_t>(width));
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); ++x)
      for (std::size_t c = 0; c < 3; ++c)
        out[4 * x + c] = static_cast<std::int16_t>(
            1500 * std::sin(begin[c] + static_cast<double>(x) * 6.28 / period) + noise(random_));
    return out;
  }
  std::mt19937 random_{11};

 private:
  int made_ = 0;
};

TEST_P(QuickRows, QuadsAreWeighedSums) {
  const QuadWeights weights{{9000, -2000, 3000, 1000, 32767, -32768, 0, 2048, 6144}, {2449, 4809, 934}};
  for (const int width : kWidths) {
    const auto difference = row(3 * width, -8160, 8160);
    const auto sum = row(3 * width, 0, 16320);
    const auto count = static_cast<std::size_t>(width);
    std::vector<std::int16_t> quads(4 * count, 7), luma(count);
    kernels().to_quads(difference.data(), sum.data(), width, weights, quads.data(), luma.data());
    for (std::size_t x = 0; x < count; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        int whole = 0;
        for (std::size_t i = 0; i < 3; ++i) whole += difference[3 * x + i] * weights.colour[3 * c + i];
        ASSERT_EQ(quads[4 * x + c], std::clamp(whole >> 15, -32768, 32767)) << x << " of " << width;
      }
      ASSERT_EQ(quads[4 * x + 3], 0);
      int whole = 0;
      for (std::size_t i = 0; i < 3; ++i) whole += sum[3 * x + i] * weights.luma[i];
      ASSERT_EQ(luma[x], whole >> 15);
    }
  }
}

TEST_P(QuickRows, CrossingsGoOnTheSameWay) {
  for (const int width : kWidths) {
    for (const int least : {16, 900}) {
      auto q = least == 16 ? row(4 * width, -32768, 32767) : quads(width, 9);
      for (std::size_t i = 3; i < q.size(); i += 4) q[i] = 0;
      std::vector<Crossing> out(static_cast<std::size_t>(width));
      const int found = kernels().crossings(q.data(), width, static_cast<std::int16_t>(least), out.data());
      int next = 0;
      for (int x = 1; x + 2 < width; ++x) {
        unsigned channels = 0;
        for (int c = 0; c < 3; ++c) {
          const auto at = [&](int i) { return q[static_cast<std::size_t>(4 * i + c)]; };
          const int rise = at(x + 2) - at(x - 1);
          const bool crosses = (at(x) > 0) != (at(x + 1) > 0);
          const bool the_way = at(x + 1) > 0 ? rise >= least : rise <= -least;
          channels |= (crosses && the_way ? 1U : 0U) << c;
        }
        if (channels == 0) continue;
        ASSERT_LT(next, found) << x << " of " << width;
        ASSERT_EQ(out[static_cast<std::size_t>(next)].x, x);
        ASSERT_EQ(out[static_cast<std::size_t>(next++)].channels, channels);
      }
      ASSERT_EQ(next, found) << width;
    }
  }
}

// Channels that cross at one place are weighed by their slopes' squares, as the best mean is.
TEST_P(QuickRows, GatheredPlacesAreMeansBySlope) {
  std::vector<std::int16_t> q(4 * 40);
  for (int x = 0; x < 40; ++x) {
    q[static_cast<std::size_t>(4 * x)] = static_cast<std::int16_t>(100 * x - 1050);      // at 10.5
    q[static_cast<std::size_t>(4 * x + 1)] = static_cast<std::int16_t>(2220 - 200 * x);  // at 11.1
    q[static_cast<std::size_t>(4 * x + 2)] = static_cast<std::int16_t>(10 * x - 255);    // at 25.5
  }
  std::array<Crossing, 40> crossings;
  std::array<QuickPlace, 40> places;
  const int found = kernels().crossings(q.data(), 40, 16, crossings.data());
  ASSERT_EQ(kernels().gather(q.data(), crossings.data(), found, places.data()), 2);
  EXPECT_NEAR(places[0].column_px, (1 * 10.5 + 4 * 11.1) / 5, 1e-4);
  EXPECT_NEAR(places[0].slope, std::sqrt(100.0 * 100 + 200 * 200), 1e-2);
  EXPECT_NEAR(places[1].column_px, 25.5, 1e-4);
  EXPECT_NEAR(places[1].slope, 10, 1e-4);
}

TEST_P(QuickRows, SidesAreSumsWithTheirSigns) {
  for (const int width : {1, 4, 17, 643}) {
    for (int round = 0; round < 20; ++round) {
      const auto q = round % 2 == 0 ? quads(width, 7) : quads(width, 40);
      std::uniform_int_distribution<int> counts(1, std::min(QuadSpans::kMost, width));
      std::vector<QuadSpans> spans(9);
      for (QuadSpans& s : spans) {
        s.left_count = static_cast<std::int16_t>(counts(random_));
        s.right_count = static_cast<std::int16_t>(counts(random_));
        const auto any = [&](int count) {
          return static_cast<std::int16_t>(std::uniform_int_distribution<int>(0, width - count)(random_));
        };
        s.left_first = any(s.left_count);
        s.right_first = any(s.right_count);
      }
      std::vector<QuadSides> out(spans.size()), same(spans.size());
      kernels().sides(q.data(), spans.data(), static_cast<int>(spans.size()), 20, out.data());
      reference().sides(q.data(), spans.data(), static_cast<int>(spans.size()), 20, same.data());
      for (std::size_t i = 0; i < spans.size(); ++i) {
        EXPECT_EQ(out[i].left, same[i].left);
        EXPECT_EQ(out[i].right, same[i].right);
        EXPECT_EQ(out[i].code, same[i].code);
        EXPECT_EQ(out[i].clear, same[i].clear);
        for (std::size_t c = 0; c < 3; ++c) {
          float sum = 0;
          for (int x = spans[i].left_first; x < spans[i].left_first + spans[i].left_count; ++x)
            sum += q[4 * static_cast<std::size_t>(x) + c];
          EXPECT_EQ(out[i].left[c], sum);
          EXPECT_EQ(out[i].code >> (3 + c) & 1, sum > 0 ? 1 : 0);
        }
      }
    }
  }
}

TEST_P(QuickRows, ExtremesAreOfNineColumnsAndThreeLines) {
  constexpr int kAround = QuickKernels::kAround;
  for (const int width : kWidths) {
    const std::array lines{row(width, 0, 4080), row(width, 0, 4080), row(width, 0, 4080)};
    std::vector<std::int16_t> brightest(lines[0].size(), -1), darkest(lines[0].size(), -1);
    kernels().extremes(lines[0].data(), lines[1].data(), lines[2].data(), width, brightest.data(),
                       darkest.data());
    for (int x = kAround; x < width - kAround; ++x) {
      std::int16_t most = 0;
      std::int16_t least = 32767;
      for (const auto& line : lines) {
        const auto [low, high] =
            std::minmax_element(line.begin() + x - kAround, line.begin() + x + kAround + 1);
        most = std::max(most, *high);
        least = std::min(least, *low);
      }
      ASSERT_EQ(brightest[static_cast<std::size_t>(x)], most) << x << " of " << width;
      ASSERT_EQ(darkest[static_cast<std::size_t>(x)], least) << x << " of " << width;
    }
  }
}

/// Whatever the processor, a frame's results are the same.
TEST_P(QuickRows, GatherEqualsTheReferenceToTheLastBit) {
  for (const int width : kWidths) {
    const auto q = quads(width, 8);
    const auto count = static_cast<std::size_t>(width);
    std::vector<Crossing> crossings(count);
    std::vector<QuickPlace> own(count), same(count);
    const int found = reference().crossings(q.data(), width, 16, crossings.data());
    const int n = kernels().gather(q.data(), crossings.data(), found, own.data());
    ASSERT_EQ(n, reference().gather(q.data(), crossings.data(), found, same.data()));
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
      ASSERT_EQ(own[i].column_px, same[i].column_px);
      ASSERT_EQ(own[i].slope, same[i].slope);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, QuickRows, testing::Range(std::size_t{0}, all_quick_kernels().size()),
                         [](const auto& test) { return std::string(all_quick_kernels()[test.param].name); });

}  // namespace
}  // namespace relievo
