// SPDX-License-Identifier: Apache-2.0
// Where a line and the next one show different surfaces, and what is not mixed there.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <tuple>

#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/line_steps.h"
#include "tests/unit/capture/drawn_frame.h"

namespace relievo {
namespace {

constexpr int kWidth = 256;
constexpr int kRows = 64;
constexpr float kStripe_px = 9;
constexpr std::array<double, 9> kIdentity{1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr std::array<Primary, 12> kStripes{1, 6, 4, 5, 2, 3, 1, 2, 6, 5, 3, 4};

/// Stripes that lean by `lean_px` a row; from row `edge` on of another surface, which shows them
/// `shift_px` further on. No light from the projector above row `lit_from`.
struct Scene {
  Scan scan = Scan::kInterlaced;
  int edge = kRows;
  float shift_px = 0;
  float lean_px = 0;
  int lit_from = 0;

  bool lit(int row, int x, int channel) const {
    const float at = static_cast<float>(x) + lean_px * static_cast<float>(row) + (row < edge ? 0 : shift_px);
    const auto stripe = static_cast<std::size_t>(at / kStripe_px) % kStripes.size();
    return (kStripes[stripe] >> channel & 1) != 0;
  }
  CapturedFrame frame() const {
    return drawn_frame(scan, kWidth, kRows, [&](int row, int x, int channel, bool complement) {
      return static_cast<std::uint8_t>(row >= lit_from && lit(row, x, channel) != complement ? 150 : 20);
    });
  }
};

LineSteps steps_of(const Scene& scene, int threads = 1) {
  const CapturedFrame frame = scene.frame();
  WorkerPool pool(threads);
  LineStepFinder finder;
  LineSteps out;
  finder.find(DetectionLines(frame), pool, out);
  finder.find(DetectionLines(frame), pool, out);  // from scratch
  return out;
}

int count(const LineSteps& steps) {
  int out = 0;
  for (const std::uint8_t step : steps.below) out += step;
  return out;
}

class LineStepsOf : public ::testing::TestWithParam<std::tuple<Scan, int>> {
 protected:
  Scene scene{.scan = std::get<0>(GetParam()), .edge = std::get<1>(GetParam()), .shift_px = 40};
  int last_above() const {  // line of the upper surface
    return scene.scan == Scan::kInterlaced ? (scene.edge - 1) / 2 : scene.edge - 1;
  }
};

TEST_P(LineStepsOf, LieBetweenTheSurfacesAndNowhereElse) {
  const LineSteps steps = steps_of(scene);
  int between = 0;
  for (int block = 0; block < steps.blocks; ++block) {
    const bool below = (steps.of_block(last_above(), block) & LineSteps::kBelow) != 0;
    EXPECT_EQ(below, (steps.of_block(last_above() + 1, block) & LineSteps::kAbove) != 0);
    between += below;
  }
  // Here and there both show the same colours.
  EXPECT_GT(between, steps.blocks * 2 / 3);
  EXPECT_EQ(count(steps), between);
  EXPECT_TRUE(steps.beside(last_above()));
  EXPECT_TRUE(steps.beside(last_above() + 1));
  EXPECT_FALSE(steps.beside(last_above() - 1));
  EXPECT_FALSE(steps.beside(last_above() + 2));
  EXPECT_EQ(steps_of(scene, 3).below, steps.below);
}

TEST_P(LineStepsOf, NeitherSurfaceIsMixedWithTheOther) {
  const auto difference_of = [](const Scene& shown, bool aligned) {
    const CapturedFrame frame = shown.frame();
    WorkerPool pool(1);
    Differencer differencer(kIdentity);
    DifferenceImage out;
    if (aligned) {
      differencer.aligned_difference(DetectionLines(frame), pool, out);
    } else {
      differencer.difference(DetectionLines(frame), pool, out);
    }
    return out;
  };
  Scene upper = scene;
  upper.edge = kRows;
  Scene lower = scene;
  lower.edge = 0;
  const DifferenceImage both = difference_of(scene, true);
  const DifferenceImage mixed = difference_of(scene, false);  // as the paper's decoder
  EXPECT_FALSE(mixed.steps.beside(last_above()));
  for (const bool above : {true, false}) {
    const DifferenceImage alone = difference_of(above ? upper : lower, true);
    const int line = last_above() + (above ? 0 : 1);
    double off = 0, off_mixed = 0;
    for (int x = 16; x < kWidth - 16; ++x) {
      // Where the next block is mixed, the last pixel of this one is not as alone.
      if (both.steps.at(line, x - 1) == 0 || both.steps.at(line, x) == 0 || both.steps.at(line, x + 1) == 0)
        continue;
      for (int c = 0; c < 3; ++c) {
        const int i = c * kWidth + x;
        off = std::max(off, static_cast<double>(std::fabs(both.line(line)[i] - alone.line(line)[i])));
        off_mixed =
            std::max(off_mixed, static_cast<double>(std::fabs(mixed.line(line)[i] - alone.line(line)[i])));
      }
    }
    EXPECT_LT(off, 0.01) << above;
    EXPECT_GT(off_mixed, 40) << above;
  }
}

INSTANTIATE_TEST_SUITE_P(, LineStepsOf,
                         ::testing::Combine(::testing::Values(Scan::kInterlaced, Scan::kProgressive),
                                            ::testing::Values(30, 31)),
                         [](const auto& of) {
                           return std::string(to_string(std::get<0>(of.param))) + "Edge" +
                                  std::to_string(std::get<1>(of.param));
                         });

TEST(LineSteps, StripesThatLeanAreOneSurface) {
  for (const Scan scan : {Scan::kInterlaced, Scan::kProgressive})
    EXPECT_EQ(count(steps_of({.scan = scan, .lean_px = 0.45F})), 0) << to_string(scan);
}

TEST(LineSteps, BesideADarkSurfaceThereIsNothingToMix) {
  EXPECT_EQ(count(steps_of({.lit_from = 31})), 0);
  EXPECT_EQ(count(steps_of({.lit_from = 30})), 0);
}

TEST(LineSteps, APictureOfOneLineHasNone) {
  CapturedFrame frame{.scan = Scan::kProgressive};
  frame.picture = Image8(kWidth, 1, 3);
  frame.complement = Image8(kWidth, 1, 3);
  WorkerPool pool(1);
  LineSteps out;
  LineStepFinder().find(DetectionLines(frame), pool, out);
  EXPECT_EQ(count(out), 0);
  EXPECT_FALSE(out.beside(0));
}

}  // namespace
}  // namespace relievo
