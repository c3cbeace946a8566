// SPDX-License-Identifier: Apache-2.0
// What the consistency check asks of each boundary of a line: the portable kernels against their definition,
// and every other set of instructions that this machine has against the portable ones, with neighbours
// missing.
#include "capture/reconstruct/consistency_rows.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr std::array kCounts{1, 2, 7, 8, 9, 40, 299};
constexpr NeighbourhoodLimits kLimits{.across_px = 0.4F,
                                      .across_share = 0.08F,
                                      .along_px = 0.25F,
                                      .noise = 2,
                                      .squeezed = 0.75F,
                                      .squeezed_each = 0.95F,
                                      .squeezed_alone = 0.6F};
constexpr InstantRules kInstant{.share = 0.25F,
                                .worst_px = 0.3F,
                                .still_px = 0.15F,
                                .alike_px = 0.3F,
                                .alike_share = 0.15F,
                                .furthest_px = 3};

class ConsistencyRows : public testing::TestWithParam<std::size_t> {
 protected:
  const ConsistencyKernels& kernels() const { return all_consistency_kernels()[GetParam()]; }
  const ConsistencyKernels& reference() const { return all_consistency_kernels().front(); }

  /// Columns about `spacing_px` apart, of which some are missing and some where another surface has them;
  /// four more on both sides hold nothing.
  struct Row {
    std::vector<float> cells;
    const float* at0() const { return cells.data() + 4; }
    float* at0() { return cells.data() + 4; }
  };
  Row columns(int count, float off_px) {
    std::normal_distribution<float> scatter(0, 0.3F);
    std::uniform_int_distribution<int> die(0, 9);
    Row out{std::vector<float>(static_cast<std::size_t>(count) + 24, kNone)};
    for (int b = 0; b < count; ++b) {
      const int shown = die(random_);
      if (shown == 0) continue;
      out.at0()[b] = 6.5F * static_cast<float>(b) + off_px + scatter(random_) - (shown == 1 ? 8.F : 0.F);
    }
    return out;
  }
  Row sigmas(int count) {
    std::uniform_real_distribution<float> any(0.01F, 0.4F);
    Row out{std::vector<float>(static_cast<std::size_t>(count) + 24)};
    for (float& v : out.cells) v = any(random_);
    return out;
  }
  std::mt19937 random_{5};
};

/// Equal, or both nothing.
bool same(float a, float b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

TEST_P(ConsistencyRows, NeighbourhoodsAreAsTheyAreDefined) {
  for (const int count : kCounts) {
    for (int round = 0; round < 40; ++round) {
      const Row above = columns(count, 0.1F), here = columns(count, 0), below = columns(count, -0.1F);
      const Row noise = sigmas(count);
      std::vector<std::uint8_t> out(static_cast<std::size_t>(count) + 8);
      kernels().neighbourhoods({above.at0(), here.at0(), below.at0()}, noise.at0(), 0.05F, count, kLimits,
                               out.data());
      for (int b = 0; b < count; ++b) {
        const float* x = here.at0() + b;
        if (std::isnan(x[0])) continue;
        const float noise_px = std::max(noise.at0()[b], 0.05F);
        const float across = x[-1] - 2 * x[0] + x[1];
        const float along = above.at0()[b] - 2 * x[0] + below.at0()[b];
        unsigned wanted = std::isnan(across) ? Neighbourhood::kOpenAcross : 0;
        if (std::fabs(across) > 0.4F + 0.08F * (0.5F * (x[1] - x[-1])) + 2 * noise_px)
          wanted |= Neighbourhood::kBentAcross;
        if (std::isnan(along)) wanted |= Neighbourhood::kOpenAlong;
        if (std::fabs(along) > 0.25F + 2 * noise_px) wanted |= Neighbourhood::kBentAlong;
        const float left = x[0] - x[-1];
        const float right = x[1] - x[0];
        const float before = x[-1] - x[-2];
        const float after = x[2] - x[1];
        bool squeezed = false;
        if (left < 0 || right < 0) {
          squeezed = false;
        } else if (std::isnan(right)) {
          squeezed = left < 0.6F * before;
        } else if (std::isnan(left)) {
          squeezed = right < 0.6F * after;
        } else {
          squeezed = left + right < 2 * 0.75F * std::min(before, after) && left < 0.95F * before &&
                     right < 0.95F * after;
        }
        if (squeezed) wanted |= Neighbourhood::kSqueezed;
        ASSERT_EQ(out[static_cast<std::size_t>(b)], wanted) << b << " of " << count;
      }
    }
  }
}

TEST_P(ConsistencyRows, WhatSmoothingMovedIsSurer) {
  for (const int count : kCounts) {
    const Row measured = columns(count, 0), noise = sigmas(count);
    Row smooth = measured;
    for (int b = 0; b < count; b += 3) smooth.at0()[b] += 0.01F;
    const Row before = sigmas(count);
    Row sigma = before;
    kernels().average(measured.at0(), smooth.at0(), noise.at0(), count, 0.3F, sigma.at0());
    for (int b = 0; b < count; ++b) {
      if (std::isnan(measured.at0()[b])) continue;
      const float variance = before.at0()[b] * before.at0()[b];
      const float gone = 0.3F * noise.at0()[b] * noise.at0()[b];
      const float wanted =
          b % 3 == 0 ? std::sqrt(std::max(0.5F * variance, variance - gone)) : before.at0()[b];
      ASSERT_FLOAT_EQ(sigma.at0()[b], wanted) << b;
    }
  }
}

TEST_P(ConsistencyRows, GoesBackToTheInstantWithItsNeighbours) {
  constexpr int kCount = 12;
  const auto straight = [](float off_px) {
    Row out{std::vector<float>(kCount + 24, kNone)};
    for (int b = 0; b < kCount; ++b) out.at0()[b] = 6 * static_cast<float>(b) + off_px;
    return out;
  };
  const Row above = straight(2), here = straight(2), below = straight(2), before = straight(0);
  Row was = before;
  was.at0()[3] = kNone;  // not seen before
  was.at0()[6] = 33.5F;  // another code: moved unlike its neighbours
  const Row sigma{std::vector<float>(kCount + 24, 0.1F)};
  Row before_sigma = sigma;
  before_sigma.at0()[9] = 0.4F;  // too unsure
  Row column = straight(0), out_sigma = sigma;
  kernels().to_instant({{above.at0(), here.at0(), below.at0()},
                        {before.at0(), was.at0(), before.at0()},
                        sigma.at0(),
                        before_sigma.at0()},
                       kCount, kInstant, column.at0(), out_sigma.at0());
  for (int b = 0; b < kCount; ++b) {
    const bool stays = b == 3 || b == 6 || b == 9;
    EXPECT_FLOAT_EQ(column.at0()[b], here.at0()[b] - (stays ? 0 : 0.25F * 2)) << b;
    EXPECT_FLOAT_EQ(out_sigma.at0()[b], stays ? 0.1F : 0.1F * std::sqrt(0.75F * 0.75F + 0.25F * 0.25F)) << b;
  }
}

/// Whatever the processor, a frame's results are the same.
TEST_P(ConsistencyRows, EqualTheReferenceToTheLastBit) {
  for (const int count : kCounts) {
    for (int round = 0; round < 20; ++round) {
      const std::array now{columns(count, 0.2F), columns(count, 0), columns(count, -0.3F)};
      const std::array before{columns(count, 0.4F), columns(count, 0.2F), columns(count, 0)};
      const Row sigma = sigmas(count), before_sigma = sigmas(count);
      const TwoFrames frames{{now[0].at0(), now[1].at0(), now[2].at0()},
                             {before[0].at0(), before[1].at0(), before[2].at0()},
                             sigma.at0(),
                             before_sigma.at0()};
      std::array<Row, 2> column{now[1], now[1]}, out{sigma, sigma}, averaged{sigma, sigma};
      std::array<std::vector<std::uint8_t>, 2> around;
      for (const std::size_t i : {0U, 1U}) {
        const ConsistencyKernels& k = i == 0 ? kernels() : reference();
        around[i].resize(static_cast<std::size_t>(count) + 8);
        k.neighbourhoods(frames.now, sigma.at0(), 0.02F, count, kLimits, around[i].data());
        k.to_instant(frames, count, kInstant, column[i].at0(), out[i].at0());
        k.average(now[1].at0(), now[0].at0(), before_sigma.at0(), count, 0.3F, averaged[i].at0());
      }
      EXPECT_EQ(around[0], around[1]);
      for (int b = 0; b < count; ++b) {
        ASSERT_TRUE(same(column[0].at0()[b], column[1].at0()[b])) << b;
        ASSERT_TRUE(same(out[0].at0()[b], out[1].at0()[b])) << b;
        ASSERT_TRUE(same(averaged[0].at0()[b], averaged[1].at0()[b])) << b;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, ConsistencyRows, testing::Range(std::size_t{0}, all_consistency_kernels().size()),
                         [](const auto& test) {
                           return std::string(all_consistency_kernels()[test.param].name);
                         });

}  // namespace
}  // namespace relievo
