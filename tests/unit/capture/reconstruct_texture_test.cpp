// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/texture.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/make_surface.h"

namespace relievo {
namespace {

Image8 random_picture(int width, int height, std::uint64_t seed, std::uint32_t most = 256) {
  test::Random random(seed);
  Image8 picture(width, height, 3);
  for (std::size_t i = 0; i < picture.size(); ++i)
    picture.data()[i] = static_cast<std::uint8_t>(random.below(most));
  return picture;
}

Image8 texture_of(const CapturedFrame& frame, int threads = 1) {
  WorkerPool pool(threads);
  Image8 out;
  add_fields(frame, pool, out);
  return out;
}

TEST(Texture, ProgressiveIsTheSumSaturated) {
  CapturedFrame frame;
  frame.scan = Scan::kProgressive;
  frame.picture = random_picture(21, 9, 1);
  frame.complement = random_picture(21, 9, 2);
  const Image8 out = texture_of(frame);
  ASSERT_EQ(out.size(), frame.picture.size());
  int saturated = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const int sum = frame.picture.data()[i] + frame.complement.data()[i];
    ASSERT_EQ(out.data()[i], std::min(255, sum));
    saturated += sum > 255;
  }
  EXPECT_GT(saturated, 0);
}

TEST(Texture, InterlacedAddsTheMeanOfTheOtherFieldsRows) {
  for (const int height : {2, 3, 8, 9}) {
    CapturedFrame frame;
    frame.picture = random_picture(13, height, 4);
    const Image8 out = texture_of(frame);
    ASSERT_EQ(out.height(), height);
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* own = frame.picture.row(y);
      // At the first and last row there is one row of the other field only.
      const std::uint8_t* above = frame.picture.row(y == 0 ? 1 : y - 1);
      const std::uint8_t* below = frame.picture.row(y == height - 1 ? height - 2 : y + 1);
      for (int i = 0; i < 13 * 3; ++i) {
        const double mean = 0.5 * (above[i] + below[i]);
        ASSERT_NEAR(out.row(y)[i], std::min(255.0, own[i] + mean), 0.5) << "row " << y << " of " << height;
      }
    }
  }
}

TEST(Texture, ComplementaryStripesAddUpToWhite) {
  CapturedFrame frame;
  frame.picture = Image8(12, 6, 3);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 12; ++x)
      for (int c = 0; c < 3; ++c) {
        const bool lit = ((x / 4 + c) % 2 == 0) == (y % 2 == 0);
        frame.picture.row(y)[3 * x + c] = lit ? 200 : 30;
      }
  const Image8 out = texture_of(frame);
  EXPECT_TRUE(std::all_of(out.data(), out.data() + out.size(), [](std::uint8_t v) { return v == 230; }));
}

TEST(Texture, OneRowHasNoOtherField) {
  CapturedFrame frame;
  frame.picture = random_picture(13, 1, 4, 128);
  const Image8 out = texture_of(frame);
  ASSERT_EQ(out.size(), frame.picture.size());
  EXPECT_TRUE(std::equal(out.data(), out.data() + out.size(), frame.picture.data()));
}

TEST(Texture, ThreadsAndReuseGiveTheSame) {
  CapturedFrame frame;
  frame.picture = random_picture(37, 23, 9);
  const Image8 serial = texture_of(frame);
  for (const int threads : {2, 3, 40}) {
    const Image8 out = texture_of(frame, threads);
    EXPECT_TRUE(std::equal(out.data(), out.data() + out.size(), serial.data())) << threads;
  }
  WorkerPool pool(1);
  Image8 reused(5, 5, 3);
  add_fields(frame, pool, reused);
  ASSERT_EQ(reused.size(), serial.size());
  const std::uint8_t* memory = reused.data();
  add_fields(frame, pool, reused);
  EXPECT_EQ(reused.data(), memory);
  EXPECT_TRUE(std::equal(reused.data(), reused.data() + reused.size(), serial.data()));
}

}  // namespace
}  // namespace relievo
