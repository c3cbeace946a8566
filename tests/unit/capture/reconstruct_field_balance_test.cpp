// SPDX-License-Identifier: Apache-2.0
// Proves: what makes one exposure of a frame brighter than the other is measured, channel by channel, and
// taken out.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "capture/reconstruct/field_balance.h"
#include "tests/support/simulated.h"

namespace relievo {
namespace {

const std::string kScene = "object,period=20";

void scale(std::uint8_t* row, int width, const std::array<double, 3>& by) {
  for (int i = 0; i < 3 * width; ++i)
    row[i] =
        static_cast<std::uint8_t>(std::lround(std::min(255.0, by[static_cast<std::size_t>(i % 3)] * row[i])));
}

/// The exposure under the complement, each channel `by` times as bright.
void scale_complement(CapturedFrame& frame, const std::array<double, 3>& by) {
  if (frame.scan == Scan::kProgressive) {
    for (int y = 0; y < frame.complement.height(); ++y)
      scale(frame.complement.row(y), frame.complement.width(), by);
    return;
  }
  const int first = frame.field_order == FieldOrder::kTop ? 1 : 0;
  for (int y = first; y < frame.picture.height(); y += 2)
    scale(frame.picture.row(y), frame.picture.width(), by);
}

TEST(FieldBalance, TellsByHowMuchEachChannelIsBrighter) {
  const std::array<double, 3> by{0.85, 0.9, 0.95};
  for (const char* scan : {",field_order=top", ",field_order=bottom", ",scan=progressive"}) {
    const test::Simulated filmed(kScene + scan);
    WorkerPool pool(2);
    FieldBalance balance(filmed.rig.colour_matrix);
    CapturedFrame frame = filmed.frame(3);
    const CapturedFrame& level = balance.balance(frame, pool);
    EXPECT_EQ(&level, &frame) << scan << ": both exposures of one brightness";
    for (const double excess : balance.excess_of_channels()) EXPECT_NEAR(excess, 0, 4e-3) << scan;

    scale_complement(frame, by);
    const CapturedFrame balanced = balance.balance(frame, pool).clone();
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(balance.excess_of_channels()[c], 2 * (1 - by[c]) / (1 + by[c]), 8e-3)
          << scan << " channel " << c;
    balance.balance(balanced, pool);
    for (const double excess : balance.excess_of_channels())
      EXPECT_NEAR(excess, 0, 6e-3) << scan << ", what is left";
  }
}

TEST(FieldBalance, LeavesWhatShowsNoStripes) {
  WorkerPool pool(1);
  FieldBalance balance({1, 0, 0, 0, 1, 0, 0, 0, 1});
  for (const int height : {1, 2, 64}) {
    CapturedFrame frame;
    frame.picture = Image8(64, height, 3);
    for (int y = 0; y < height; ++y) std::fill_n(frame.picture.row(y), 3 * 64, y % 2 == 0 ? 100 : 200);
    EXPECT_EQ(&balance.balance(frame, pool), &frame) << height << " rows";
  }
}

}  // namespace
}  // namespace relievo
