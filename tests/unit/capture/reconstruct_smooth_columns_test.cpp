// SPDX-License-Identifier: Apache-2.0
// Smoothers: the portable one on columns whose answer is known, and every other set of instructions that this
// machine has against the portable one.
#include "capture/reconstruct/smooth_columns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kLongest = 96;
constexpr std::size_t kAround = 8;

struct Columns {
  std::array<std::vector<float>, 7> rows;
  std::vector<float> noises = std::vector<float>(kLongest, 0.F);

  Columns() {
    for (auto& row : rows) row.assign(kLongest, kNone);
  }
  std::vector<float> smoothed(const Smoother& smoother, int count, float usual_px) const {
    std::array<const float*, 7> at{};
    for (std::size_t i = 0; i < 7; ++i) at[i] = rows[i].data();
    std::vector<float> out(kLongest, -1.F);
    std::vector<float> bends(kLongest + 2 * kAround, kNone);
    smoother.smooth(at, noises.data(), count, usual_px, bends.data() + kAround, out.data());
    return out;
  }
};

class Smoothers : public testing::TestWithParam<std::size_t> {
 protected:
  const Smoother& smoother() const { return smoothers()[GetParam()]; }
};

TEST_P(Smoothers, AStraightBoundaryIsPutOnItsLine) {
  Columns columns;
  for (std::size_t i = 0; i < 7; ++i) columns.rows[i][0] = 10 + 0.5F * static_cast<float>(i);
  columns.rows[3][0] += 0.07F;
  // All seven lines count the same.
  EXPECT_NEAR(columns.smoothed(smoother(), 1, 0.1F)[0], 11.5F + 0.01F, 1e-5);
  // Off the line by more than noise lets it: it stays.
  EXPECT_EQ(columns.smoothed(smoother(), 1, 0.001F)[0], columns.rows[3][0]);
  columns.noises[0] = 0.1F;  // but not where its own noise is greater
  EXPECT_NEAR(columns.smoothed(smoother(), 1, 0.001F)[0], 11.51F, 1e-5);
}

TEST_P(Smoothers, ABentBoundaryKeepsItsBend) {
  Columns columns;
  for (int i = -3; i <= 3; ++i) {
    const auto row = static_cast<std::size_t>(i + 3);
    columns.rows[row][0] = 10 + 0.5F * static_cast<float>(i * i);
    columns.rows[row][1] = columns.rows[row][0];
  }
  columns.rows[0][1] = kNone;  // five lines left, and the quadratic through them
  columns.rows[3][1] += 0.035F;
  const auto out = columns.smoothed(smoother(), 2, 0.05F);
  EXPECT_NEAR(out[0], 10, 2e-3);  // a thousandth of the bend may be noise
  EXPECT_NEAR(out[1], 10 + 0.035F * 17 / 35, 1e-5);
}

/// Mean and standard deviation of what smoothing leaves in noise of 1, where boundaries have this bend.
std::pair<double, double> left_of_noise(const Smoother& smoother, float bend) {
  std::mt19937 random(11);
  std::normal_distribution<float> normal(0, 1);
  constexpr int kCount = 64, kRounds = 200;
  double sum = 0, squares = 0;
  for (int round = 0; round < kRounds; ++round) {
    Columns columns;
    for (std::size_t i = 0; i < 7; ++i) {
      const float y = static_cast<float>(i) - 3;
      for (std::size_t b = 0; b < kCount; ++b) columns.rows[i][b] = bend * y * y + normal(random);
    }
    const auto out = columns.smoothed(smoother, kCount, 1);
    for (std::size_t b = 0; b < kCount; ++b) {
      sum += static_cast<double>(out[b]);
      squares += static_cast<double>(out[b] * out[b]);
    }
  }
  const double n = kCount * kRounds, mean = sum / n;
  return {mean, std::sqrt(squares / n - mean * mean)};
}

TEST_P(Smoothers, ASurfaceThatIsBentIsNotMadeFlatterByNoise) {
  const auto [flat, of_flat] = left_of_noise(smoother(), 0);
  EXPECT_NEAR(flat, 0, 0.03);
  EXPECT_LT(of_flat, 0.46);  // a straight line leaves 0.38, a quadratic 0.58
  // A straight line would leave 4 times the bend.
  const auto [bent, of_bent] = left_of_noise(smoother(), 0.2F);
  EXPECT_NEAR(bent, 0, 0.15);
  EXPECT_LT(of_bent, 0.56);
  const auto [more, of_more] = left_of_noise(smoother(), 0.4F);
  EXPECT_NEAR(more, 0, 0.1);
  EXPECT_LT(of_more, 0.56);
}

TEST_P(Smoothers, WithoutNeighboursAColumnStaysAndNothingStaysNothing) {
  Columns columns;
  columns.rows[3][0] = 7;
  columns.rows[2][1] = columns.rows[4][1] = 7;
  const auto out = columns.smoothed(smoother(), 2, 1);
  EXPECT_EQ(out[0], 7);
  EXPECT_TRUE(std::isnan(out[1]));
}

TEST_P(Smoothers, EqualTheReferenceToTheLastBit) {
  std::mt19937 random(9);
  std::normal_distribution<float> normal(0, 1);
  std::bernoulli_distribution missing(0.1), rough(0.3);
  for (const int count : {1, 7, 8, 9, 89}) {
    for (int round = 0; round < 40; ++round) {
      Columns columns;
      for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b) {
        const float slope = 0.2F * normal(random), bend = 0.05F * normal(random);
        for (std::size_t i = 0; i < 7; ++i) {
          const auto y = static_cast<float>(i) - 3;
          if (!missing(random))
            columns.rows[i][b] =
                100 + slope * y + bend * y * y + (rough(random) ? 1 : 0.05F) * normal(random);
        }
        columns.noises[b] = 0.1F * std::fabs(normal(random));
      }
      const auto got = columns.smoothed(smoother(), count, 0.05F);
      const auto expected = columns.smoothed(smoothers().front(), count, 0.05F);
      for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b)
        ASSERT_TRUE(got[b] == expected[b] || (std::isnan(got[b]) && std::isnan(expected[b]))) << b;
    }
  }
}

TEST_P(Smoothers, AcrossBoundariesEqualTheReferenceToTheLastBit) {
  constexpr std::size_t kFirst = 8, kBeyond = 24;
  std::mt19937 random(10);
  std::normal_distribution<float> normal(0, 1);
  std::bernoulli_distribution missing(0.05), unknown(0.05), rough(0.1);
  for (const int count : {1, 7, 8, 9, 16, 89}) {
    for (int round = 0; round < 40; ++round) {
      const std::size_t size = kFirst + static_cast<std::size_t>(count) + kBeyond;
      std::vector<float> columns(size, kNone), sigmas(size, 0.F);
      for (std::size_t i = kFirst; i < size - kBeyond; ++i) {
        if (!missing(random))
          columns[i] = 6 * static_cast<float>(i) + (rough(random) ? 0.5F : 0.02F) * normal(random);
        sigmas[i] = unknown(random) ? 0 : 0.03F * std::fabs(normal(random));
      }
      auto expected_columns = columns, expected_sigmas = sigmas;
      const auto before = columns;
      smoother().across(columns.data() + kFirst, sigmas.data() + kFirst, count);
      smoothers().front().across(expected_columns.data() + kFirst, expected_sigmas.data() + kFirst, count);
      for (std::size_t i = 0; i < size; ++i) {
        const bool both_none = std::isnan(columns[i]) && std::isnan(expected_columns[i]);
        ASSERT_TRUE(columns[i] == expected_columns[i] || both_none) << i;
        ASSERT_EQ(sigmas[i], expected_sigmas[i]) << i;
        ASSERT_EQ(std::isnan(columns[i]), std::isnan(before[i])) << i;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, Smoothers, testing::Range(std::size_t{0}, smoothers().size()),
                         [](const auto& test) { return std::string(smoothers()[test.param].name); });

}  // namespace
}  // namespace relievo
