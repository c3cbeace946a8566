// SPDX-License-Identifier: Apache-2.0
// Proves: a stream whose content changes comes below its bit rate within a second and stays there, is as fine
// as the rate allows, and no finer than asked for. Sizes of a model first, then those of the real encoder.
#include "server/rate_control.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "tests/support/make_surface.h"

namespace relievo {
namespace {

constexpr double kRate = 30;
constexpr int kSecond = 30;

double level_size(int level) {
  return rate_levels()[static_cast<std::size_t>(level)].size;
}

/// Bits in the second before frame `end`.
double bits(const std::vector<std::size_t>& sizes, std::size_t end) {
  return 8 * std::accumulate(sizes.begin() + static_cast<std::ptrdiff_t>(end - kSecond),
                             sizes.begin() + static_cast<std::ptrdiff_t>(end), 0.0);
}

/// Frames of which one at level 0 takes `bytes`, `key_times` as much where it is a key frame.
struct Model {
  int key_interval = 1;
  double key_times = 1;
  std::vector<std::size_t> sizes;
  std::vector<int> levels;

  void run(RateControl& control, int frames, double bytes) {
    for (int i = 0; i < frames; ++i) {
      const bool is_key = static_cast<int>(sizes.size()) % key_interval == 0;
      levels.push_back(control.level());
      sizes.push_back(
          static_cast<std::size_t>(bytes * (is_key ? key_times : 1) * level_size(control.level())));
      control.add(sizes.back(), is_key, key_interval);
    }
  }
};

TEST(RateControl, LevelsAreCoarserAndSmallerFromOneToTheNext) {
  const auto levels = rate_levels();
  ASSERT_GT(levels.size(), 5u);
  for (std::size_t i = 1; i < levels.size(); ++i) {
    EXPECT_LT(levels[i].size, levels[i - 1].size);
    EXPECT_LT(levels[i].texture_quality, levels[i - 1].texture_quality);
    EXPECT_LE(levels[i].step_bits, levels[i - 1].step_bits);
  }
}

TEST(RateControl, ContentThatGrowsFourfoldIsBelowTheRateASecondLater) {
  for (const auto& [interval, key_times] : {std::pair{1, 1.0}, {30, 5.0}}) {
    RateControl control(4e6, kRate);
    Model model{interval, key_times, {}, {}};
    model.run(control, 4 * kSecond, 15'000);
    EXPECT_LE(bits(model.sizes, model.sizes.size()), 4e6) << interval;
    model.run(control, kSecond, 60'000);
    model.run(control, 3 * kSecond, 60'000);
    for (std::size_t end = 6 * kSecond; end <= model.sizes.size(); end += kSecond)
      EXPECT_LE(bits(model.sizes, end), 1.02 * 4e6) << interval << " at " << end;
  }
}

TEST(RateControl, WhatFitsIsAsFineAsItCanBe) {
  RateControl control(4e6, kRate);
  Model model;
  model.run(control, 10 * kSecond, 100'000);
  const int coarse = control.level();
  EXPECT_GT(coarse, 4);
  model.run(control, 10 * kSecond, 25'000);
  EXPECT_LT(control.level(), coarse);
  EXPECT_GT(bits(model.sizes, model.sizes.size()), 0.6 * 4e6) << "it need not be so coarse";
  model.run(control, 10 * kSecond, 5'000);
  EXPECT_EQ(control.level(), 0);
}

TEST(RateControl, SteadyContentHasASteadyLevel) {
  RateControl control(4e6, kRate);
  Model model;
  model.run(control, 10 * kSecond, 40'000);
  const int level = control.level();
  for (std::size_t i = 5 * kSecond; i < model.levels.size(); ++i) EXPECT_EQ(model.levels[i], level);
}

TEST(RateControl, WhatNothingCanHelpIsAsCoarseAsItGets) {
  RateControl control(1e5, kRate);
  Model model;
  model.run(control, 2 * kSecond, 500'000);
  EXPECT_EQ(control.level(), static_cast<int>(rate_levels().size()) - 1);
}

TEST(RateControl, NothingIsFinerThanAskedFor) {
  RateControl control(1e9, kRate);
  Model model;
  model.run(control, 5 * kSecond, 100);
  EncodeOptions options;
  options.texture_quality = 33;
  options.step_bits = 1;
  control.apply(options);
  EXPECT_EQ(options.texture_quality, 33);
  EXPECT_EQ(options.step_bits, 1);
}

/// A calm picture, then one full of detail.
Image8 picture(int number, bool busy) {
  Image8 image = test::picture(320, 240);
  test::Random random(static_cast<std::uint64_t>(number));
  for (std::size_t i = 0; busy && i < image.size(); ++i)
    image.data()[i] = static_cast<std::uint8_t>(image.data()[i] / 2 + random.below(96));
  return image;
}

TEST(RateControl, TheRealEncoderIsKeptBelowTheRate) {
  RateControl control(3e6, kRate);
  FrameEncoder encoder{Rig{}, Pattern{}};
  std::vector<std::size_t> sizes;
  for (int number = 0; number < 5 * kSecond; ++number) {
    Frame3D frame;
    frame.texture = picture(number, number >= 2 * kSecond);
    EncodeOptions options;
    options.texture_quality = 95;
    control.apply(options);
    const auto bytes = encoder.encode(frame, options);
    ASSERT_TRUE(bytes.ok()) << bytes.error().message;
    control.add(bytes->size(), is_key_frame(*bytes), options.key_interval);
    sizes.push_back(bytes->size());
  }
  EXPECT_LE(bits(sizes, 2 * kSecond), 3e6);
  EXPECT_GT(8 * kRate * static_cast<double>(sizes[2 * kSecond]), 3e6) << "the change is one";
  EXPECT_LE(bits(sizes, 4 * kSecond), 1.02 * 3e6);
  EXPECT_LE(bits(sizes, 5 * kSecond), 1.02 * 3e6);
}

}  // namespace
}  // namespace relievo
