// SPDX-License-Identifier: Apache-2.0
// The white texture's kernels: the portable ones against their definition, and every other set of
// instructions that this machine has against the portable ones, on random and extreme rows of any width.
#include "capture/reconstruct/white_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "capture/reconstruct/rows.h"

namespace relievo {
namespace {

constexpr std::array kSamples{1, 2, 3, 6, 7, 8, 9, 15, 16, 17, 31, 33, 48, 63, 101, 640, 1929};

class WhiteRows : public testing::TestWithParam<std::size_t> {
 protected:
  const WhiteKernels& kernels() const { return all_white_kernels()[GetParam()]; }
  const WhiteKernels& reference() const { return all_white_kernels().front(); }

  /// Every third row has nothing but the two extremes.
  template <typename T>
  std::vector<T> row(int count, double least, double most) {
    const bool extremes = ++made_ % 3 == 0;
    std::uniform_real_distribution<double> any(least, most);
    std::bernoulli_distribution coin;
    std::vector<T> out(static_cast<std::size_t>(count));
    for (auto& v : out) v = static_cast<T>(!extremes ? any(random_) : coin(random_) ? most : least);
    return out;
  }

 private:
  std::mt19937 random_{5};
  int made_ = 0;
};

TEST_P(WhiteRows, OtherField) {
  for (const int n : kSamples) {
    for (int repeat = 0; repeat < 6; ++repeat) {
      const auto own = row<std::uint8_t>(n, 0, 255), over = row<std::uint8_t>(n, 0, 255),
                 under = row<std::uint8_t>(n, 0, 255);
      const auto above = row<float>(n, 0, 255), below = row<float>(n, 0, 255);
      const LitRows rows{own.data(), over.data(), under.data(), above.data(), below.data()};
      const auto of = [&](const WhiteKernels& k) {
        std::vector<std::int16_t> a(own.size() + 2), b(a.size());
        std::vector<float> out(own.size());
        k.other_field(rows, n, {a.data() + 1, b.data() + 1}, out.data());
        return out;
      };
      const auto out = of(kernels());
      ASSERT_EQ(out, of(reference())) << n;
      for (int i = 0; i < n; ++i) {
        const auto differs = [&](const std::vector<std::uint8_t>& other) {
          double sum = 0;
          for (const int k : {std::max(i - 1, 0), i, std::min(i + 1, n - 1)}) {
            const auto at = static_cast<std::size_t>(k);
            sum += std::abs(own[at] - other[at]);
          }
          return sum * sum + RowKernels::kAlike * RowKernels::kAlike;
        };
        const auto at = static_cast<std::size_t>(i);
        const double share = differs(under) / (differs(over) + differs(under));
        ASSERT_NEAR(out[at], share * above[at] + (1 - share) * below[at], 1e-3) << n << ' ' << i;
      }
    }
  }
}

TEST_P(WhiteRows, StoreSum) {
  for (const int n : kSamples) {
    for (int repeat = 0; repeat < 6; ++repeat) {
      const auto a = row<float>(n, -300, 600), b = row<float>(n, -300, 600);
      std::vector<std::uint8_t> out(a.size()), expected(a.size());
      kernels().store_sum(a.data(), b.data(), n, out.data());
      reference().store_sum(a.data(), b.data(), n, expected.data());
      ASSERT_EQ(out, expected) << n;
      for (std::size_t i = 0; i < a.size(); ++i)
        ASSERT_EQ(out[i], std::floor(std::clamp(a[i] + b[i] + 0.5F, 0.F, 255.F))) << n << ' ' << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, WhiteRows, testing::Range(std::size_t{0}, all_white_kernels().size()),
                         [](const auto& one) { return std::string(all_white_kernels()[one.param].name); });

}  // namespace
}  // namespace relievo
