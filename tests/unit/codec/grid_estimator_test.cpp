// SPDX-License-Identifier: Apache-2.0
// The profiles metric and visual: estimates are nearer the truth than what was measured, on what stands still
// and on what moves, and lag behind nothing; bounds are kept; both cost fewer bits.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "codec/frame3d_codec.h"
#include "codec/geometry_profile.h"
#include "codec/grid_estimator.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

constexpr float kNoise_px = 0.15F;
constexpr int kStepBits = 8;

/// As measured with noise that its sigmas tell; `shift_px`: of the nearer surface.
Frame3D measured_frame(std::uint64_t seed, float shift_px) {
  Frame3D frame = test::grid_frame({.noise_px = kNoise_px, .shift_px = shift_px, .seed = seed});
  for (GridPoint& p : frame.surface.grid) p.sigma_px = kNoise_px / std::sqrt(3.F);
  return frame;
}

using Place = std::pair<int, int>;
std::map<Place, float> true_columns(float shift_px) {
  std::map<Place, float> out;
  for (const std::uint64_t seed : {1, 2})  // each has other holes
    for (const GridPoint& p :
         test::grid_frame({.noise_px = 0, .shift_px = shift_px, .seed = seed}).surface.grid)
      out[{p.line, p.boundary}] = p.column_px;
  return out;
}

/// What lies at the nearer surface of make_grid.h, `margin` of the picture within its edge; negative: around
/// the edge alone.
bool is_near(const GridPoint& p, float margin) {
  const float distance =
      std::hypot(static_cast<float>(p.boundary) / 39 - 0.62F, static_cast<float>(p.line) / 240 - 0.45F);
  return margin > 0 ? distance < 0.22F - margin : std::fabs(distance - 0.22F) < -margin;
}

struct Errors {
  double measured_rms = 0, estimated_rms = 0, estimated_mean = 0;
};

/// After that many frames, of the vertices that `counts` chooses. `speed_px`: of the nearer surface, a frame.
Errors errors_after(int frames, float speed_px, const std::function<bool(const GridPoint&)>& counts) {
  const test::GridScene scene;
  const GridCalibration calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  GridEstimator estimator;
  StripeGrid grid;
  std::vector<std::uint8_t> tolerance;
  Frame3D frame;
  for (int f = 0; f < frames; ++f) {
    frame = measured_frame(static_cast<std::uint64_t>(f) + 10, speed_px * static_cast<float>(f));
    EXPECT_TRUE(
        to_grid(frame.surface, calibration, {.step_bits = kStepBits, .with_quality = true}, grid).ok());
    estimator.estimate(frame.surface, grid, tolerance);
  }
  const auto truth = true_columns(speed_px * static_cast<float>(frames - 1));
  Errors out;
  double n = 0;
  for (const GridPoint& p : frame.surface.grid) {
    const auto expected = truth.find({p.line, p.boundary});
    if (expected == truth.end() || !counts(p)) continue;
    const double measured = static_cast<double>(p.column_px - expected->second);
    const double estimated =
        static_cast<double>(grid.columns[grid.at(p.line, p.boundary)]) / (1 << kStepBits) -
        static_cast<double>(expected->second);
    ++n;
    out.measured_rms += measured * measured;
    out.estimated_rms += estimated * estimated;
    out.estimated_mean += estimated;
  }
  EXPECT_GT(n, 200);
  out.measured_rms = std::sqrt(out.measured_rms / n);
  out.estimated_rms = std::sqrt(out.estimated_rms / n);
  out.estimated_mean /= n;
  return out;
}

bool everywhere(const GridPoint&) {
  return true;
}

TEST(GridEstimator, OneFrameIsSmoothedAlongTheSurface) {
  const Errors e = errors_after(1, 0, everywhere);
  EXPECT_LT(e.estimated_rms, 0.75 * e.measured_rms);
}

TEST(GridEstimator, WhatStandsStillGetsExacterFrameByFrame) {
  const Errors e = errors_after(12, 0, everywhere);
  EXPECT_LT(e.estimated_rms, 0.5 * e.measured_rms);
  EXPECT_LT(std::fabs(e.estimated_mean), 0.05 * e.measured_rms);
}

TEST(GridEstimator, WhatMovesIsNotDraggedBehind) {
  // Slower than the noise can show at one place, and by several stripes' noise.
  for (const float speed_px : {0.03F, 0.1F, 0.5F, 3.F}) {
    const Errors e = errors_after(8, speed_px, [](const GridPoint& p) { return is_near(p, 0.03F); });
    EXPECT_LT(e.estimated_rms, 0.8 * e.measured_rms) << speed_px;
    EXPECT_LT(std::fabs(e.estimated_mean), 0.2 * e.measured_rms) << speed_px;
  }
}

TEST(GridEstimator, NothingIsSmoothedAcrossADepthStep) {
  for (const float speed_px : {0.F, 3.F}) {
    const Errors e = errors_after(8, speed_px, [](const GridPoint& p) { return is_near(p, -0.02F); });
    EXPECT_LT(e.estimated_rms, 1.02 * e.measured_rms) << speed_px;
  }
}

TEST(GridEstimator, APictureMayHaveFewLines) {
  for (const int lines : {1, 2, 3, 4, 8}) {
    const test::GridScene scene{.height = 2 * lines};
    const GridCalibration calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
    const Frame3D frame = test::grid_frame(scene);
    GridEstimator estimator;
    StripeGrid grid;
    std::vector<std::uint8_t> tolerance;
    ASSERT_TRUE(to_grid(frame.surface, calibration, {.step_bits = kStepBits}, grid).ok());
    estimator.estimate(frame.surface, grid, tolerance);
    for (const GridPoint& p : frame.surface.grid)
      EXPECT_NEAR(static_cast<float>(grid.columns[grid.at(p.line, p.boundary)]) / (1 << kStepBits),
                  p.column_px, 0.3F)
          << lines;
  }
}

TEST(GridEstimator, StartsAnewOnAnotherGridAndWhenToldTo) {
  const test::GridScene scene;
  const GridCalibration calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  const Frame3D frame = measured_frame(1, 0);
  std::vector<std::uint8_t> tolerance;
  StripeGrid fresh, used;
  GridEstimator one, other;
  ASSERT_TRUE(
      to_grid(frame.surface, calibration, {.step_bits = kStepBits, .with_quality = true}, fresh).ok());
  one.estimate(frame.surface, fresh, tolerance);
  const test::GridScene large{.width = 800, .stripes = 60};
  ASSERT_TRUE(to_grid(test::grid_frame(large).surface,
                      grid_calibration(test::grid_rig(large), test::grid_pattern(large)),
                      {.step_bits = kStepBits, .with_quality = true}, used)
                  .ok());
  other.estimate(test::grid_frame(large).surface, used, tolerance);
  for (int again = 0; again < 2; ++again) {
    ASSERT_TRUE(
        to_grid(frame.surface, calibration, {.step_bits = kStepBits, .with_quality = true}, used).ok());
    other.estimate(frame.surface, used, tolerance);
    EXPECT_EQ(used.columns, fresh.columns);
    other.forget();
  }
}

/// Bytes of ten frames of a scene that moves at the end, under a profile, and what the last one decodes to.
std::size_t bytes_of_ten(const char* profile,
                         const std::function<void(const Frame3D&, const Surface&)>& look) {
  const test::GridScene scene;
  EncodeOptions options;
  EXPECT_TRUE(set_geometry_profile(profile, options));
  options.texture = TextureCodec::kNone;
  options.step_bits = 6;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  FrameDecoder decoder;
  std::size_t bytes = 0;
  for (int f = 0; f < 10; ++f) {
    const Frame3D frame =
        measured_frame(static_cast<std::uint64_t>(f) + 1, f < 7 ? 0 : 0.7F * static_cast<float>(f));
    const auto coded = encoder.encode(frame, options);
    EXPECT_TRUE(coded) << coded.error().message;
    bytes += coded->size();
    const auto back = decoder.decode(*coded);
    EXPECT_TRUE(back) << back.error().message;
    look(frame, back->surface);
  }
  return bytes;
}

TEST(GeometryProfiles, MetricCostsLessThanTheMeasurementAndKeepsEveryVertex) {
  const auto same_places = [](const Frame3D& frame, const Surface& got) {
    ASSERT_EQ(got.grid.size(), frame.surface.grid.size());
    for (std::size_t i = 0; i < got.grid.size(); ++i) {
      ASSERT_EQ(got.grid[i].boundary, frame.surface.grid[i].boundary);
      // No vertex is farther from its measurement than noise can bring it.
      ASSERT_LT(std::fabs(got.grid[i].column_px - frame.surface.grid[i].column_px), 4 * kNoise_px) << i;
    }
  };
  EXPECT_LT(bytes_of_ten("metric", same_places), bytes_of_ten("grid", same_places) * 3 / 4);
}

TEST(GeometryProfiles, VisualKeepsItsBoundOnEveryVertex) {
  const auto within = [](const Frame3D& frame, const Surface& got) {
    ASSERT_EQ(got.grid.size(), frame.surface.grid.size());
    for (std::size_t i = 0; i < got.grid.size(); ++i)
      ASSERT_LE(std::fabs(got.grid[i].column_px - frame.surface.grid[i].column_px), 0.5F + 1e-4F) << i;
  };
  const std::size_t grid = bytes_of_ten("grid", [](const Frame3D&, const Surface&) {});
  EXPECT_LT(bytes_of_ten("visual", within), grid / 3);
}

/// Noise beyond any bound, sigmas that lie, jumps, and holes that come and go: what a certificate is for.
TEST(GeometryProfiles, VisualKeepsItsBoundWhateverTheSceneDoes) {
  const test::GridScene scene;
  for (const float bound_px : {0.02F, 0.5F, 1.F, 8.F}) {
    EncodeOptions options;
    ASSERT_TRUE(set_geometry_profile("visual", options));
    options.texture = TextureCodec::kNone;
    options.bound_px = bound_px;
    options.key_interval = 4;
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    FrameDecoder decoder;
    test::Random random(7);
    for (std::uint64_t f = 0; f < 9; ++f) {
      Frame3D frame = test::grid_frame({.noise_px = f % 3 == 0 ? 5.F : 0.3F,
                                        .shift_px = f % 2 == 0 ? 0.F : 6.F * random.unit(),
                                        .seed = f + 1});
      for (GridPoint& p : frame.surface.grid)
        p.sigma_px = std::array{0.F, 1e-4F, 0.1F, 60.F}[random.below(4)];
      const auto coded = encoder.encode(frame, options);
      ASSERT_TRUE(coded) << coded.error().message;
      const auto header = read_frame_header(*coded);
      ASSERT_TRUE(header && header->geometry == GeometryCodec::kGrid);
      const auto back = decoder.decode(*coded);
      ASSERT_TRUE(back) << back.error().message;
      std::map<Place, float> sent;
      for (const GridPoint& p : back->surface.grid) sent[{p.line, p.boundary}] = p.column_px;
      ASSERT_EQ(sent.size(), frame.surface.grid.size());
      for (const GridPoint& p : frame.surface.grid) {
        const auto at = sent.find({p.line, p.boundary});
        ASSERT_NE(at, sent.end());
        ASSERT_LE(std::fabs(at->second - p.column_px), bound_px + 1e-4F) << f;
      }
    }
  }
}

TEST(GeometryProfiles, BoundsOutOfRangeAreRefused) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  EncodeOptions options;
  ASSERT_TRUE(set_geometry_profile("visual", options));
  for (const float bound : {-1.F, 0.001F, 8.5F, NAN}) {
    options.bound_px = bound;
    EXPECT_FALSE(encoder.encode(test::grid_frame(scene), options)) << bound;
  }
  EXPECT_FALSE(set_geometry_profile("visuel", options));
}

}  // namespace
}  // namespace relievo
