// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/colour_shift.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace relievo {
namespace {

constexpr std::array<double, 9> kPlain{1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr int kWidth = 80;
constexpr Primary kRed = 1, kGreen = 2, kCyan = 6, kMagenta = 5;
constexpr std::size_t kSharp = 0, kMost = ColourShift::kBlurs - 1;

/// Brightness that grows by a factor of e^`growth` a pixel.
std::vector<float> growing(double growth) {
  std::vector<float> out;
  for (int x = 0; x < kWidth; ++x) out.push_back(static_cast<float>(20 * std::exp(growth * (x - 40))));
  return out;
}

ShiftQuery boundary_at(const std::vector<float>& white, float column_px, Primary left, Primary right) {
  return {white.data(), kWidth, column_px, {left, right}, -1e4F, 1e4F, {left, right}};
}

TEST(ColourShift, IsNoneOnAnEvenSurface) {
  const ColourShift shift(kPlain);
  const std::vector<float> white = growing(0);
  for (std::size_t b = 0; b < ColourShift::kBlurs; ++b)
    EXPECT_NEAR(shift.shift_px(boundary_at(white, 40.3F, kRed, kMagenta), b), 0, 0.02);
}

// A Gaussian blur of exp(g x) s(x) crosses zero g times its variance on the darker side of where s does; what
// is read off between two samples of that curve, up to a quarter of g further.
TEST(ColourShift, OfALowPassAloneIsItsVarianceTimesTheGrowth) {
  const ColourShift shift(kPlain);
  for (const double growth : {-0.2, 0.1, 0.2}) {
    const std::vector<float> white = growing(growth);
    EXPECT_NEAR(shift.shift_px(boundary_at(white, 40, kRed, kMagenta), kSharp), -0.5 * growth,
                0.25 * std::fabs(growth));
  }
}

TEST(ColourShift, GrowsWithTheBlurButNotAsFarAsBlurredLumaWould) {
  const ColourShift shift(kPlain);
  constexpr double kGrowth = 0.1;
  const std::vector<float> white = growing(kGrowth);
  double last = 0;
  for (std::size_t b = 0; b < ColourShift::kBlurs; ++b) {
    const double px = shift.shift_px(boundary_at(white, 40, kRed, kMagenta), b);
    EXPECT_LT(px, last);
    const double blur = ColourShift::kBlur_px[b];
    EXPECT_GT(px, -(0.5 + blur * blur) * kGrowth - 0.02);
    last = px;
  }
  EXPECT_LT(last, -0.3);
}

TEST(ColourShift, IsOfTheChannelsThatFlip) {
  const ColourShift shift(kPlain);
  const std::vector<float> white = growing(0.1);
  // Green is most of luma, which is not blurred; blue is the least of it.
  const float green = shift.shift_px(boundary_at(white, 40, kRed, kRed | kGreen), kMost);
  const float blue = shift.shift_px(boundary_at(white, 40, kRed, kMagenta), kMost);
  EXPECT_LT(blue, green);
  EXPECT_LT(green, 0);
  // All three: luma and colours together.
  const float all = shift.shift_px(boundary_at(white, 40, kRed, kCyan), kMost);
  EXPECT_LT(all, 0);
}

TEST(ColourShift, KnowsTheStripesBehindTheNextBoundaries) {
  const ColourShift shift(kPlain);
  const std::vector<float> white = growing(0);
  ShiftQuery query = boundary_at(white, 40, kRed, kMagenta);
  query.right_end_px = 44;
  query.beyond_colours[1] = kGreen;
  // Where blue ends again soon, the blur has less of it, and rises over zero later.
  EXPECT_GT(shift.shift_px(query, kMost), shift.shift_px(query, kSharp));
}

TEST(ColourShift, LeavesWhatIsNearThePicturesEnds) {
  const ColourShift shift(kPlain);
  const std::vector<float> white = growing(0.2);
  for (const float column_px : {0.F, 5.F, kWidth - 6.F, kWidth - 1.F})
    EXPECT_EQ(shift.shift_px(boundary_at(white, column_px, kRed, kMagenta), kMost), 0);
}

TEST(ColourShift, EveryKernelGivesTheSame) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> grey(0, 400);
  std::uniform_real_distribution<float> share(0, 1);
  std::uniform_int_distribution<int> colour(0, 1);
  for (int i = 0; i < 200; ++i) {
    StripedRow row{.first_px = 100,
                   .column_px = 110 + share(random),
                   .left_end_px = 102 + 6 * share(random),
                   .right_end_px = 113 + 6 * share(random),
                   .luma = {share(random), share(random), share(random)},
                   .grey = {share(random), share(random), share(random)}};
    StripedRow::Kernel blur;
    for (float& weight : blur) weight = share(random);
    row.blur = &blur;
    for (float& white : row.white) white = grey(random);
    for (auto& signs : row.signs)
      for (float& sign : signs) sign = colour(random) != 0 ? 1.F : -1.F;
    std::array<StripedRow::Out, 3> expected{};
    blur_kernels().front().differences(row, expected);
    for (const BlurKernel& kernel : blur_kernels()) {
      std::array<StripedRow::Out, 3> out{};
      kernel.differences(row, out);
      EXPECT_EQ(out, expected) << kernel.name;
    }
  }
}

}  // namespace
}  // namespace relievo
