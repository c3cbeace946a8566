// SPDX-License-Identifier: Apache-2.0
// Row kernels: the portable ones against their definition, and every other set of instructions that this
// machine has against the portable ones, on random and extreme rows of any width.
#include "capture/reconstruct/rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace relievo {
namespace {

constexpr std::array kWidths{1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 31, 33, 64, 101, 640, 643};

/// Rows of random samples between `least` and `most`; every third row has nothing but the two extremes.
class RowMaker {
 public:
  template <typename T>
  std::vector<T> row(int samples, int least, int most) {
    const bool extremes = ++made_ % 3 == 0;
    std::uniform_int_distribution<int> any(least, most);
    std::bernoulli_distribution coin;
    std::vector<T> out(static_cast<std::size_t>(samples));
    for (T& v : out) v = static_cast<T>(!extremes ? any(random_) : coin(random_) ? most : least);
    return out;
  }

 private:
  std::mt19937 random_{7};
  int made_ = 0;
};

int at(const std::vector<std::int16_t>& row, int i) {
  return row[static_cast<std::size_t>(i)];
}

class Rows : public testing::TestWithParam<std::size_t> {
 protected:
  const RowKernels& kernels() const { return all_row_kernels()[GetParam()]; }
  RowMaker make;
};

TEST_P(Rows, AddRows) {
  for (const int width : kWidths) {
    const int samples = 3 * width;
    const auto own = make.row<std::uint8_t>(samples, 0, 255);
    const auto above = make.row<std::uint8_t>(samples, 0, 255);
    const auto below = make.row<std::uint8_t>(samples, 0, 255);
    std::vector<std::uint8_t> out(own.size());
    kernels().add_rows(own.data(), above.data(), below.data(), samples, out.data());
    for (std::size_t i = 0; i < out.size(); ++i)
      ASSERT_EQ(out[i], std::min(255, own[i] + (above[i] + below[i] + 1) / 2)) << i << " of " << samples;
    kernels().add_rows(own.data(), above.data(), above.data(), samples, out.data());
    for (std::size_t i = 0; i < out.size(); ++i) ASSERT_EQ(out[i], std::min(255, own[i] + above[i]));
  }
}

TEST_P(Rows, WeaveRows) {
  for (const int width : kWidths) {
    const int samples = 3 * width;
    const auto own = make.row<std::uint8_t>(samples, 0, 255), above = make.row<std::uint8_t>(samples, 0, 255),
               below = make.row<std::uint8_t>(samples, 0, 255);
    auto beyond_above = make.row<std::uint8_t>(samples, 0, 255);
    const auto beyond_below = make.row<std::uint8_t>(samples, 0, 255);
    for (std::size_t i = 0; i < own.size() / 2; ++i) beyond_above[i] = own[i];  // one surface
    const WovenRows rows{own.data(), above.data(), below.data(), beyond_above.data(), beyond_below.data()};
    std::vector<std::uint8_t> scratch(2 * own.size() + 4), out(own.size()), reference(own.size());
    kernels().weave_rows(rows, samples, scratch.data(), out.data());
    all_row_kernels().front().weave_rows(rows, samples, scratch.data(), reference.data());
    ASSERT_EQ(out, reference) << width;
    for (int i = 0; i < samples; ++i) {
      double a = 0, b = 0;
      for (int k = i - 1; k <= i + 1; ++k) {
        const auto at = static_cast<std::size_t>(std::clamp(k, 0, samples - 1));
        a += std::abs(own[at] - beyond_above[at]);
        b += std::abs(own[at] - beyond_below[at]);
      }
      const auto at = static_cast<std::size_t>(i);
      const double share = (b * b + 576) / (a * a + b * b + 2 * 576);
      const double sum = own[at] + below[at] + share * (above[at] - below[at]);
      ASSERT_NEAR(out[at], std::min(sum, 255.0), 0.501) << i << " of " << samples;
    }
  }
}

TEST_P(Rows, CombineFields) {
  for (const int width : kWidths) {
    const int samples = 3 * width;
    const auto slide = make.row<std::uint8_t>(samples, 0, 255);
    const auto above = make.row<std::uint8_t>(samples, 0, 255);
    const auto below = make.row<std::uint8_t>(samples, 0, 255);
    std::vector<std::int16_t> difference(slide.size()), sum(slide.size());
    kernels().combine_fields(slide.data(), above.data(), below.data(), samples,
                             {difference.data(), sum.data()});
    for (std::size_t i = 0; i < slide.size(); ++i) {
      ASSERT_EQ(difference[i], 2 * slide[i] - above[i] - below[i]);
      ASSERT_EQ(sum[i], 2 * slide[i] + above[i] + below[i]);
    }
  }
}

TEST_P(Rows, LowPass) {
  for (const int width : kWidths) {
    const int samples = 3 * width;
    const auto above = make.row<std::int16_t>(samples, -510, 1020);
    const auto here = make.row<std::int16_t>(samples, -510, 1020);
    const auto below = make.row<std::int16_t>(samples, -510, 1020);
    std::vector<std::int16_t> across(above.size()), out(above.size());
    kernels().low_pass(above.data(), here.data(), below.data(), samples, across.data(), out.data());
    const auto column = [&](int i) { return at(above, i) + 2 * at(here, i) + at(below, i); };
    for (int i = 0; i < samples; ++i) {
      const bool end = i < 3 || i + 3 >= samples;
      ASSERT_EQ(at(out, i), end ? 4 * column(i) : column(i - 3) + 2 * column(i) + column(i + 3));
    }
  }
}

TEST_P(Rows, PairProducts) {
  for (const int width : kWidths) {
    const int samples = 3 * width;
    const auto own = make.row<std::uint8_t>(samples, 0, 255);
    const auto other = make.row<std::uint8_t>(samples, 0, 255);
    const auto next_own = make.row<std::uint8_t>(samples, 0, 255);
    const auto next_other = make.row<std::uint8_t>(samples, 0, 255);
    const int blocks = width / RowKernels::kPairBlock_px;
    std::vector<PairProducts> out(static_cast<std::size_t>(blocks) + 1);
    kernels().pair_products({own.data(), other.data(), next_own.data(), next_other.data()}, blocks,
                            out.data());
    for (int block = 0; block < blocks; ++block) {
      int across = 0, here = 0, next = 0;
      for (int i = 3 * RowKernels::kPairBlock_px * block; i < 3 * RowKernels::kPairBlock_px * (block + 1);
           ++i) {
        const auto k = static_cast<std::size_t>(i);
        const int p = own[k] - other[k];
        const int q = next_own[k] - next_other[k];
        across += p * q;
        here += p * p;
        next += q * q;
      }
      const PairProducts& sums = out[static_cast<std::size_t>(block)];
      ASSERT_EQ(sums.across, across) << block << " of " << width;
      ASSERT_EQ(sums.here, here) << block << " of " << width;
      ASSERT_EQ(sums.next, next) << block << " of " << width;
    }
    ASSERT_EQ(out.back().here, 0) << "written beyond the last block";
  }
}

TEST_P(Rows, ToPlanes) {
  const PlaneWeights weights{{0.9F, -0.2F, 0.3F, 0.1F, 1.1F, -0.4F, 0.F, 0.25F, 0.75F}, {0.3F, 0.6F, 0.1F}};
  for (const int width : kWidths) {
    auto difference = make.row<std::int16_t>(3 * width, -8160, 8160);
    auto sum = make.row<std::int16_t>(3 * width, 0, 16320);
    std::vector<float> planes(difference.size()), white(static_cast<std::size_t>(width));
    kernels().to_planes({difference.data(), sum.data()}, width, weights, {planes.data(), white.data()});
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c <= 3; ++c) {
        const auto w = [&](int i) {
          return static_cast<double>(c < 3 ? weights.colour[static_cast<std::size_t>(3 * c + i)]
                                           : weights.luma[static_cast<std::size_t>(i)]);
        };
        const auto& rgb = c < 3 ? difference : sum;
        const double expected = w(0) * at(rgb, 3 * x) + w(1) * at(rgb, 3 * x + 1) + w(2) * at(rgb, 3 * x + 2);
        const float got =
            c < 3 ? planes[static_cast<std::size_t>(c * width + x)] : white[static_cast<std::size_t>(x)];
        ASSERT_NEAR(got, expected, 0.004) << "column " << x << " of " << width;
      }
    }
  }
}

TEST_P(Rows, Crossings) {
  for (const int width : kWidths) {
    for (const int amplitude : {2, 6, 200}) {
      const auto whole = make.row<std::int16_t>(3 * width, -amplitude, amplitude);
      const std::vector<float> planes(whole.begin(), whole.end());
      std::vector<std::uint8_t> flags(static_cast<std::size_t>(width), 255);
      kernels().crossings(planes.data(), width, 4, flags.data());
      for (int x = 0; x < width; ++x) {
        int expected = 0;
        for (int c = 0; c < 3 && x >= 2 && x + 2 < width; ++c) {
          const float* d = planes.data() + c * width + x;
          const float rise = d[2] - d[-1];
          if ((d[0] > 0) != (d[1] > 0) && std::fabs(rise) >= 4 && (rise > 0) == (d[1] > d[0]))
            expected |= 1 << c;
        }
        ASSERT_EQ(flags[static_cast<std::size_t>(x)], expected) << "column " << x << " of " << width;
      }
    }
  }
}

TEST_P(Rows, SideEvidence) {
  std::mt19937 random(11);
  for (const int width : kWidths) {
    const auto whole = make.row<std::int16_t>(3 * width, -90, 90);
    const std::vector<float> planes(whole.begin(), whole.end());
    std::uniform_int_distribution<int> first(0, width - 1), count(1, 9);
    for (int round = 0; round < 50; ++round) {
      const int left = first(random);
      const int right = first(random);
      const SideWindows windows{left,  std::min(width, left + count(random)) - 1,
                                right, std::min(width, right + count(random)) - 1,
                                0.5F,  2.5F};
      // The second of two, so that the first is not taken for it.
      const std::array two{SideWindows{0, 0, width - 1, width - 1, 1, 1}, windows};
      std::array<Sides, 2> both;
      Sides reference;
      kernels().side_evidence(planes.data(), width, two.data(), 2, both.data());
      all_row_kernels().front().side_evidence(planes.data(), width, &windows, 1, &reference);
      const Sides& got = both[1];
      ASSERT_EQ(got.left, reference.left);
      ASSERT_EQ(got.right, reference.right);
      for (const bool is_left : {true, false}) {
        const int begin = is_left ? windows.left_first : windows.right_first;
        const int end = (is_left ? windows.left_last : windows.right_last) + 1;
        std::array<double, 3> mean{};
        for (std::size_t c = 0; c < 3; ++c)
          for (int x = begin; x < end; ++x)
            mean[c] += static_cast<double>(
                           planes[c * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)]) /
                       (end - begin);
        const double strongest = std::max({std::fabs(mean[0]), std::fabs(mean[1]), std::fabs(mean[2])});
        for (std::size_t c = 0; c < 3; ++c) {
          const double expected = std::clamp(mean[c] / (0.4 * strongest + (is_left ? 0.5 : 2.5)), -1.0, 1.0);
          ASSERT_NEAR((is_left ? got.left : got.right)[c], expected, 1e-5)
              << begin << ".." << end << " of " << width;
        }
      }
    }
  }
}

/// Whatever the processor, a frame's results are the same.
TEST_P(Rows, EqualsTheReferenceToTheLastBit) {
  const RowKernels& reference = all_row_kernels().front();
  const PlaneWeights weights{{0.9F, -0.2F, 0.3F, 0.1F, 1.1F, -0.4F, 0.F, 0.25F, 0.75F}, {0.3F, 0.6F, 0.1F}};
  for (const int width : kWidths) {
    auto difference = make.row<std::int16_t>(3 * width, -8160, 8160);
    auto sum = make.row<std::int16_t>(3 * width, 0, 16320);
    std::array<std::vector<float>, 2> planes, white;
    for (std::size_t i = 0; i < 2; ++i) {
      planes[i].resize(difference.size());
      white[i].resize(static_cast<std::size_t>(width));
      (i == 0 ? reference : kernels())
          .to_planes({difference.data(), sum.data()}, width, weights, {planes[i].data(), white[i].data()});
    }
    ASSERT_EQ(planes[0], planes[1]) << width;
    ASSERT_EQ(white[0], white[1]) << width;
  }
}

INSTANTIATE_TEST_SUITE_P(, Rows, testing::Range(std::size_t{0}, all_row_kernels().size()),
                         [](const auto& test) { return std::string(all_row_kernels()[test.param].name); });

}  // namespace
}  // namespace relievo
