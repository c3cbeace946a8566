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
  /// Three planes of a line, with room behind each.
  struct Planes {
    std::vector<std::int16_t> values;
    std::size_t stride;
    QuickRow row() const { return {values.data(), values.data() + stride, values.data() + 2 * stride}; }
    std::int16_t at(std::size_t channel, int x) const {
      return values[channel * stride + static_cast<std::size_t>(x)];
    }
  };
  Planes planes(int width, int least, int most) {
    const std::size_t stride = static_cast<std::size_t>(width) + 16;
    return {row(static_cast<int>(3 * stride), least, most), stride};
  }
  /// As to_planes makes them, smooth over `period` columns so that there are crossings of some length.
  Planes waves(int width, double period) {
    std::uniform_real_distribution<double> phase(0, 6.28);
    std::array<double, 3> begin{phase(random_), phase(random_), phase(random_)};
    std::uniform_int_distribution<int> noise(-20, 20);
    Planes out{{}, static_cast<std::size_t>(width) + 16};
    out.values.resize(3 * out.stride);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t x = 0; x < out.stride; ++x)
        out.values[c * out.stride + x] = static_cast<std::int16_t>(
            1500 * std::sin(begin[c] + static_cast<double>(x) * 6.28 / period) + noise(random_));
    return out;
  }
  std::mt19937 random_{11};

 private:
  int made_ = 0;
};

TEST_P(QuickRows, PlanesAreWeighedSums) {
  const QuickWeights weights{{9000, -2000, 3000, 1000, 32767, -32768, 0, 2048, 6144}, {2449, 4809, 934}};
  // Each product is rounded, and sums end where 16 bits do.
  const auto weighed = [](const std::int16_t* rgb, const std::int16_t* w) {
    int sum = 0;
    for (std::size_t i = 0; i < 3; ++i)
      sum = std::clamp(sum + static_cast<int>(std::floor(rgb[i] * w[i] / 32768.0 + 0.5)), -32768, 32767);
    return sum;
  };
  for (const int width : kWidths) {
    const auto difference = row(3 * width, -8160, 8160);
    const auto sum = row(3 * width, 0, 16320);
    const auto count = static_cast<std::size_t>(width);
    std::vector<std::int16_t> out(3 * count), luma(count);
    kernels().to_planes(difference.data(), sum.data(), width, weights, out.data(), width, luma.data());
    for (std::size_t x = 0; x < count; ++x) {
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_EQ(out[c * count + x], weighed(difference.data() + 3 * x, weights.colour.data() + 3 * c))
            << x << " of " << width;
      ASSERT_EQ(luma[x], weighed(sum.data() + 3 * x, weights.luma.data()));
    }
  }
}

TEST_P(QuickRows, CodesAreSignsAndWhetherTheyAreClear) {
  constexpr int kDoubt = 20;
  for (const int width : kWidths) {
    for (const bool smooth : {false, true}) {
      const Planes p = smooth ? waves(width, 11) : planes(width, -32768, 32767);
      std::vector<std::uint8_t> codes(static_cast<std::size_t>(width));
      kernels().codes(p.row(), width, kDoubt, codes.data());
      for (int x = 0; x < width; ++x) {
        const std::uint8_t code = codes[static_cast<std::size_t>(x)];
        int most = 0;
        int least = 32767;
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_EQ(code >> c & 1, p.at(c, x) > 0 ? 1 : 0);
          most = std::max(most, std::min(std::abs(int{p.at(c, x)}), 32767));
          least = std::min(least, std::abs(int{p.at(c, x)}));
        }
        const double wanted = QuickKernels::kClear * (QuickKernels::kClearShare * most + kDoubt);
        if (std::abs(least - wanted) > 1) {  // but for rounding
          ASSERT_EQ((code & QuickKernels::kIsClear) != 0, least > wanted) << x << " of " << width;
        }
      }
    }
  }
}

TEST_P(QuickRows, CrossingsGoOnTheSameWay) {
  for (const int width : kWidths) {
    for (const int least : {16, 900}) {
      const Planes p = least == 16 ? planes(width, -32768, 32767) : waves(width, 9);
      std::vector<Crossing> out(static_cast<std::size_t>(width));
      const int found = kernels().crossings(p.row(), width, static_cast<std::int16_t>(least), out.data());
      int next = 0;
      for (int x = 1; x + 2 < width; ++x) {
        unsigned channels = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          const int rise = p.at(c, x + 2) - p.at(c, x - 1);
          const bool crosses = (p.at(c, x) > 0) != (p.at(c, x + 1) > 0);
          const bool the_way = p.at(c, x + 1) > 0 ? rise >= least : rise <= -least;
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
  Planes p{std::vector<std::int16_t>(3 * 56), 56};
  for (std::size_t x = 0; x < 40; ++x) {
    const auto at = static_cast<int>(x);
    p.values[x] = static_cast<std::int16_t>(100 * at - 1050);         // at 10.5
    p.values[56 + x] = static_cast<std::int16_t>(2220 - 200 * at);    // at 11.1
    p.values[2 * 56 + x] = static_cast<std::int16_t>(10 * at - 255);  // at 25.5
  }
  std::array<Crossing, 40> crossings;
  std::array<QuickPlace, 40> places;
  const int found = kernels().crossings(p.row(), 40, 16, crossings.data());
  ASSERT_EQ(kernels().gather(p.row(), crossings.data(), found, places.data()), 2);
  EXPECT_NEAR(places[0].column_px, (1 * 10.5 + 4 * 11.1) / 5, 1e-4);
  EXPECT_NEAR(places[0].slope, std::sqrt(100.0 * 100 + 200 * 200), 1e-2);
  EXPECT_NEAR(places[1].column_px, 25.5, 1e-4);
  EXPECT_NEAR(places[1].slope, 10, 1e-4);
}

TEST_P(QuickRows, SidesAreSums) {
  for (const int width : {1, 4, 17, 643}) {
    for (int round = 0; round < 60; ++round) {
      const Planes p = round % 2 == 0 ? waves(width, 7) : planes(width, -32768, 32767);
      std::uniform_int_distribution<int> counts(1, std::min(QuickSpans::kMost, width));
      QuickSpans s;
      s.left_count = static_cast<std::int16_t>(counts(random_));
      s.right_count = static_cast<std::int16_t>(counts(random_));
      const auto any = [&](int count) {
        return static_cast<std::int16_t>(std::uniform_int_distribution<int>(0, width - count)(random_));
      };
      s.left_first = any(s.left_count);
      s.right_first = any(s.right_count);
      QuickSides out;
      kernels().sides(p.row(), s, out);
      const auto sum = [&](std::size_t c, int first, int count) {
        float all = 0;
        for (int x = first; x < first + count; ++x) all += p.at(c, x);
        return all;
      };
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(out.left[c], sum(c, s.left_first, s.left_count));
        EXPECT_EQ(out.right[c], sum(c, s.right_first, s.right_count));
      }
      EXPECT_EQ(out.left[3], 0);
      EXPECT_EQ(out.right[3], 0);
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
    const Planes p = waves(width, 8);
    const auto count = static_cast<std::size_t>(width);
    std::vector<Crossing> crossings(count);
    std::vector<QuickPlace> own(count + QuickKernels::kGathered), same(own.size());
    const int found = reference().crossings(p.row(), width, 16, crossings.data());
    const int n = kernels().gather(p.row(), crossings.data(), found, own.data());
    ASSERT_EQ(n, reference().gather(p.row(), crossings.data(), found, same.data()));
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
