// SPDX-License-Identifier: Apache-2.0
// Scores of surfaces whose errors are planted, so that every figure is known beforehand.
#include "capture/evaluate/score.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using test::StripedScene;

/// Every boundary on every detection line, exactly where it is.
Surface perfect(const StripedScene& scene) {
  Surface s;
  const PinholeModel& camera = scene.rig.camera;
  const int step = scene.rig.scan == Scan::kInterlaced ? 2 : 1;
  for (int row = 0; row < camera.height; row += step) {
    for (int b = 0; b < scene.pattern.boundaries(); ++b) {
      const double column = scene.camera_column(b);
      if (column < 0 || column > camera.width - 1) continue;
      const double x = (column - camera.cx()) / camera.fx();
      const double z = scene.depth(x);
      s.positions.push_back({static_cast<float>(x * z),
                             static_cast<float>((row - camera.cy()) / camera.fy() * z),
                             static_cast<float>(z)});
    }
  }
  return s;
}

/// The same rays, `factor` times as far.
void move_along_ray(Vec3f& p, float factor) {
  for (float& c : p) c *= factor;
}

Score score_of(const StripedScene& scene, const Surface& surface) {
  Scorer scorer(scene.rig, scene.pattern);
  scorer.add(draw_truth(scene), &surface);
  return scorer.score();
}

class ScorerTest : public ::testing::TestWithParam<Scan> {};

TEST_P(ScorerTest, APerfectSurface) {
  const StripedScene scene = test::striped_scene(GetParam());
  const Surface surface = perfect(scene);
  const Score s = score_of(scene, surface);
  EXPECT_EQ(s.frames, 1U);
  EXPECT_EQ(s.of, 1U);
  EXPECT_DOUBLE_EQ(s.vertices_per_frame, static_cast<double>(surface.positions.size()));
  EXPECT_DOUBLE_EQ(s.completeness, 1);
  EXPECT_DOUBLE_EQ(s.outliers, 0);
  // The truth's picture holds depth at whole pixels and is straight between them: the wall's depth is not.
  EXPECT_LT(s.median_um_per_m, 2);
  EXPECT_LT(s.p95_um_per_m, 4);
}

TEST_P(ScorerTest, PlantedErrorsAreFoundToTheFigure) {
  StripedScene scene = test::striped_scene(GetParam());
  scene.slope = 0;  // constant depth: moving a vertex along its ray is a depth error alone
  Surface surface = perfect(scene);
  const std::size_t n = surface.positions.size();
  for (std::size_t i = 0; i < n; ++i) move_along_ray(surface.positions[i], i % 4 == 0 ? 1.0004F : 0.9999F);
  Score s = score_of(scene, surface);
  EXPECT_DOUBLE_EQ(s.completeness, 1);
  EXPECT_DOUBLE_EQ(s.outliers, 0);
  EXPECT_NEAR(s.median_um_per_m, 100, 0.2);
  EXPECT_NEAR(s.p95_um_per_m, 400, 0.2);
  EXPECT_NEAR(s.rms_um_per_m, std::sqrt(0.25 * 400 * 400 + 0.75 * 100 * 100), 1);

  // Just within and just over 2 % of depth.
  surface = perfect(scene);
  for (std::size_t i = 0; i < n; ++i) {
    if (i % 10 == 0) move_along_ray(surface.positions[i], i % 20 == 0 ? 1.0205F : 0.9795F);
    if (i % 10 == 1) move_along_ray(surface.positions[i], 1.0195F);
  }
  s = score_of(scene, surface);
  EXPECT_DOUBLE_EQ(s.outliers, static_cast<double>((n + 9) / 10) / static_cast<double>(n));
  EXPECT_LT(s.completeness, 1);
}

TEST_P(ScorerTest, MissingVerticesCostCompletenessAlone) {
  const StripedScene scene = test::striped_scene(GetParam());
  const int step = GetParam() == Scan::kInterlaced ? 2 : 1;
  Surface surface = perfect(scene);
  const double all = static_cast<double>(surface.positions.size());
  // Half of the lines. Vertices of interlaced frames stand for the row above too, which is no line.
  std::erase_if(surface.positions, [&](const Vec3f& p) {
    const double row = p[1] / p[2] * scene.rig.camera.fy() + scene.rig.camera.cy();
    return std::lround(row) % (2 * step) != 0;
  });
  ASSERT_DOUBLE_EQ(static_cast<double>(surface.positions.size()), all / 2);
  const Score s = score_of(scene, surface);
  EXPECT_DOUBLE_EQ(s.completeness, 0.5);
  EXPECT_DOUBLE_EQ(s.outliers, 0);
}

TEST_P(ScorerTest, VerticesWhereNothingIsAreOutliers) {
  const StripedScene scene = test::striped_scene(GetParam());
  Surface surface = perfect(scene);
  const Score with_truth = score_of(scene, surface);
  ASSERT_DOUBLE_EQ(with_truth.outliers, 0);
  Scorer scorer(scene.rig, scene.pattern);
  ImageF nothing(scene.rig.camera.width, scene.rig.camera.height, 1);
  scorer.add(nothing, &surface);
  const Score s = scorer.score();
  EXPECT_DOUBLE_EQ(s.outliers, 1);
  EXPECT_DOUBLE_EQ(s.completeness, 0);         // nothing was to be seen
  EXPECT_TRUE(std::isnan(s.median_um_per_m));  // there is no error to measure
}

TEST_P(ScorerTest, AFrameThatWasNotReconstructedCounts) {
  const StripedScene scene = test::striped_scene(GetParam());
  const Surface surface = perfect(scene);
  const ImageF truth = draw_truth(scene);
  Scorer scorer(scene.rig, scene.pattern);
  scorer.add(truth, &surface);
  scorer.add(truth, nullptr);
  const Score s = scorer.score();
  EXPECT_EQ(s.frames, 1U);
  EXPECT_EQ(s.of, 2U);
  EXPECT_DOUBLE_EQ(s.completeness, 0.5);
  EXPECT_DOUBLE_EQ(s.outliers, 0);
}

TEST_P(ScorerTest, WhatIsInTheShadowIsNotAskedFor) {
  // A plate in front of the wall: the wall behind it that the camera sees, but the projector does not light,
  // has no boundaries to be found.
  const StripedScene scene = test::striped_scene(GetParam());
  ImageF truth = draw_truth(scene);
  const auto expected_hits = [&](const Surface& s) {
    Scorer scorer(scene.rig, scene.pattern);
    scorer.add(truth, &s);
    return scorer.score().completeness;
  };
  const Surface wall = perfect(scene);
  ASSERT_DOUBLE_EQ(expected_hits(wall), 1);
  for (int y = 0; y < truth.height(); ++y)
    for (int x = 90; x < 110; ++x) truth.row(y)[x] = 0.7F;
  // Of the wall, only what is lit is kept: a point is in the shadow where the plate is on its light's way.
  Surface lit;
  for (const Vec3f& p : wall.positions) {
    const double column = p[0] / p[2] * scene.rig.camera.fx() + scene.rig.camera.cx();
    if (column > 89.5 && column < 109.5) continue;  // on the plate
    // The projector stands at x = 0.2: the light to p crosses z = 0.7 at
    const double x = 0.2 + (p[0] - 0.2) * 0.7 / p[2];
    const double plate = x / 0.7 * scene.rig.camera.fx() + scene.rig.camera.cx();
    if (plate > 89.5 && plate < 109.5) continue;
    lit.positions.push_back(p);
  }
  // And the plate's own boundaries.
  for (int row = 0; row < truth.height(); row += GetParam() == Scan::kInterlaced ? 2 : 1) {
    for (int b = 0; b < scene.pattern.boundaries(); ++b) {
      const double t = (scene.pattern.boundary_column_px(b, 256) - scene.rig.projector.cx()) / 300;
      const double x = t * 0.7 + 0.2;
      const double column = x / 0.7 * 200 + 79.5;
      if (column < 90 || column > 109) continue;
      lit.positions.push_back({static_cast<float>(x), static_cast<float>((row - 59.5) / 200 * 0.7), 0.7F});
    }
  }
  EXPECT_DOUBLE_EQ(expected_hits(lit), 1);
  EXPECT_LT(lit.positions.size(), wall.positions.size());
}

INSTANTIATE_TEST_SUITE_P(Scans, ScorerTest, ::testing::Values(Scan::kInterlaced, Scan::kProgressive),
                         [](const auto& scan) {
                           return scan.param == Scan::kInterlaced ? "interlaced" : "progressive";
                         });

}  // namespace
}  // namespace relievo
