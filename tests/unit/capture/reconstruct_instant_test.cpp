// SPDX-License-Identifier: Apache-2.0
// Proves: boundaries are taken back to their frame's time stamp by what they moved since the frame before,
// unless they lay on another surface then.
#include "capture/reconstruct/instant.h"

#include <gtest/gtest.h>

namespace relievo {
namespace {

constexpr int kBoundaries = 6, kLines = 8, kWidth = 640;
constexpr double kFrame_ns = 1e9 / 30;

/// A surface whose boundaries lie side by side, alike on each line.
class InstantTest : public ::testing::Test {
 protected:
  /// The first column that the filter leaves on the fourth line of the next frame, all of them seen `off_px`
  /// from where they were in the first.
  float adjusted(float off_px, const FieldMotion& motion = {}) {
    fill(off_px);
    filter_.adjust({time_ns_, motion}, result_, edges_, recovered_, pool_);
    time_ns_ += static_cast<std::int64_t>(kFrame_ns);
    return edges_.edges[edges_.line_start[3] + 2].column_px - kFirst_px - 2 * kStripe_px;
  }
  /// Of everything in the frame alike.
  static FieldMotion motion(float px) {
    FieldMotion out;
    out.cells = kWidth / FieldMotion::kCellWidth;
    out.px.assign(static_cast<std::size_t>(out.cells), px);
    out.moves = {1};
    return out;
  }

 private:
  static constexpr float kFirst_px = 200, kStripe_px = 10;

  void fill(float off_px) {
    edges_ = {};
    edges_.lines = kLines;
    result_.boundary.clear();
    for (int line = 0; line < kLines; ++line) {
      edges_.line_start.push_back(static_cast<std::uint32_t>(edges_.edges.size()));
      for (int b = 0; b < kBoundaries; ++b) {
        Edge edge;
        edge.column_px = kFirst_px + kStripe_px * static_cast<float>(b) + off_px;
        edge.sigma_px = 0.05F;
        edges_.edges.push_back(edge);
        result_.boundary.push_back(static_cast<std::int16_t>(b));
      }
    }
    edges_.line_start.push_back(static_cast<std::uint32_t>(edges_.edges.size()));
  }

  WorkerPool pool_{1};
  InstantFilter filter_{kBoundaries, kLines, kFrame_ns};
  SequenceResult result_;
  EdgeImage edges_;
  std::vector<RecoveredBoundary> recovered_;
  std::int64_t time_ns_ = 1'000'000'000;
};

TEST_F(InstantTest, WhatMovesIsTakenBackAQuarterOfAFrame) {
  adjusted(0);
  EXPECT_NEAR(adjusted(2), 2 - 0.25F * 2, 1e-4F);
}

TEST_F(InstantTest, FastMotionThatTheFieldsShowToo) {
  adjusted(0);
  EXPECT_NEAR(adjusted(-8, motion(-4)), -8 + 0.25F * 8, 1e-4F);
}

TEST_F(InstantTest, ABoundaryThatLayOnAnotherSurfaceDidNotMove) {
  adjusted(0);
  EXPECT_FLOAT_EQ(adjusted(-8), -8);
}

TEST_F(InstantTest, ABoundaryFromAnotherSurfaceMovesAsItsOwnFieldsShow) {
  adjusted(0);
  EXPECT_NEAR(adjusted(-8, motion(1)), -8 - 0.5F, 1e-4F);
}

}  // namespace
}  // namespace relievo
