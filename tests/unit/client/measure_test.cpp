// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "client/measure/shape_meter.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Of mean 0 and standard deviation 1, nearly normal.
float normal(test::Random& random) {
  float sum = -6;
  for (int i = 0; i < 12; ++i) sum += random.unit();
  return sum;
}

PinholeModel camera() {
  PinholeModel model;
  model.width = 200;
  model.height = 160;
  model.matrix = {250, 0, 99.5, 0, 250, 79.5, 0, 0, 1};
  model.distortion = {-0.1, 0.05, 0.001, -0.001, 0};
  return model;
}

/// z of each pixel of the camera's rays, as a surface of triangles two pixels wide. `z` is given x/z and y/z.
Frame3D seen(const std::function<float(double, double)>& z) {
  const PinholeModel model = camera();
  Frame3D frame;
  constexpr int kColumns = 100, kRows = 80;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double x = (2 * column - model.cx()) / model.fx(), y = (2 * row - model.cy()) / model.fy();
      const float depth = z(x, y);
      frame.surface.positions.push_back(
          {static_cast<float>(x) * depth, static_cast<float>(y) * depth, depth});
    }
  }
  for (std::uint32_t row = 0; row + 1 < kRows; ++row) {
    for (std::uint32_t column = 0; column + 1 < kColumns; ++column) {
      const std::uint32_t a = row * kColumns + column, b = a + 1, c = a + kColumns, d = c + 1;
      frame.surface.triangles.push_back({a, c, b});
      frame.surface.triangles.push_back({b, c, d});
    }
  }
  return frame;
}

/// A wall a metre away, turned by 20 degrees about the vertical: z where a ray meets it.
double wall(double x) {
  return 1 / (1 + x * std::tan(20 * kDegree));
}

constexpr PictureRegion kMiddle{60, 48, 80, 64};

TEST(FitShape, APlaneOfWhichAThirdIsSomethingElseIsThatPlane) {
  test::Random random(1);
  std::vector<Vec3f> points;
  for (int i = 0; i < 3000; ++i) {
    const float x = random.unit() - 0.5F, y = random.unit() - 0.5F;
    points.push_back(
        {x, y, i % 3 == 0 ? 0.6F + 0.3F * random.unit() : 1 + 0.5F * x + 1e-4F * normal(random)});
  }
  const auto plane = fit_shape(ShapeKind::kPlane, points);
  ASSERT_TRUE(plane);
  const double length = std::hypot(0.5, 1.0);
  EXPECT_NEAR(plane->at[0], 0.5 / length, 5e-5);
  EXPECT_NEAR(plane->at[1], 0, 5e-5);
  EXPECT_NEAR(plane->at[2], -1 / length, 5e-5);  // towards the camera
  EXPECT_NEAR(plane->size_m, 1 / length, 1e-5);
  EXPECT_NEAR(plane->height_m({0, 0, 0.9F}), 0.1 / length, 2e-5);  // before it
}

TEST(FitShape, ASphereOfWhichAThirdIsItsGroundIsThatSphere) {
  test::Random random(2);
  std::vector<Vec3f> points;
  while (points.size() < 3000) {
    const float x = 2 * random.unit() - 1, y = 2 * random.unit() - 1;
    if (x * x + y * y > 0.8F) continue;  // what is seen of it
    const float r = 0.05F + 1e-4F * normal(random);
    points.push_back({0.1F + r * x, -0.02F + r * y, 0.8F - r * std::sqrt(1 - x * x - y * y)});
    if (points.size() % 3 == 0) points.push_back({0.1F + x * 0.06F, y * 0.06F, 0.9F});
  }
  const auto sphere = fit_shape(ShapeKind::kSphere, points);
  ASSERT_TRUE(sphere);
  EXPECT_NEAR(sphere->size_m, 0.05, 3e-5);
  EXPECT_NEAR(sphere->at[0], 0.1, 2e-5);
  EXPECT_NEAR(sphere->at[1], -0.02, 2e-5);
  EXPECT_NEAR(sphere->at[2], 0.8, 4e-5);
}

TEST(FitShape, PointsThatDetermineNoneGiveNone) {
  for (const ShapeKind kind : {ShapeKind::kPlane, ShapeKind::kSphere}) {
    EXPECT_FALSE(fit_shape(kind, {}));
    EXPECT_FALSE(fit_shape(kind, std::vector<Vec3f>(3, {0, 0, 1})));
    EXPECT_FALSE(fit_shape(kind, std::vector<Vec3f>(100, {0, 0, 1})));
    std::vector<Vec3f> line;
    for (int i = 0; i < 100; ++i) line.push_back({static_cast<float>(i), 0, 1});
    EXPECT_FALSE(fit_shape(kind, line));
  }
}

TEST(ShapeMeter, AnExactWallIsWhereItIs) {
  ShapeMeter meter(camera(), {0, 0, 200, 160}, ShapeKind::kPlane);
  ASSERT_TRUE(meter.add(seen([](double x, double) { return static_cast<float>(wall(x)); })));
  const ShapeReport report = meter.report();
  EXPECT_EQ(report.frames, 1U);
  EXPECT_NEAR(report.size_m.median, 1, 1e-4);
  EXPECT_NEAR(report.tilt_deg.median, 20, 1e-3);
  EXPECT_LT(report.rms_m.median, 1e-6);
  EXPECT_LT(report.form_m, 1e-6);
  EXPECT_GT(report.filled, 0.9);  // the lens draws in what lies at the picture's rim
  EXPECT_FALSE(report.noise_m);
  EXPECT_FALSE(report.expected_m);  // nobody said how exact the points are
}

TEST(ShapeMeter, NoiseIsToldFromFormAndFromWhatWasExpected) {
  constexpr float kNoise_m = 2e-4F;
  constexpr double kBump_m = 1e-3;
  test::Random random(3);
  ShapeMeter meter(camera(), kMiddle, ShapeKind::kPlane);
  for (int i = 0; i < 40; ++i) {
    Frame3D frame = seen([&](double x, double y) {
      const double bump = kBump_m * std::sin(60 * x) * std::sin(60 * y);
      return static_cast<float>(wall(x) + bump) + kNoise_m * normal(random);
    });
    frame.surface.sigmas_m.assign(frame.surface.positions.size(), kNoise_m);
    ASSERT_TRUE(meter.add(frame));
  }
  const ShapeReport report = meter.report();
  EXPECT_EQ(report.frames, 40U);
  const double across = std::cos(20 * kDegree);  // heights are across the wall, errors along z
  const double bump_rms_m = across * kBump_m / 2;
  EXPECT_NEAR(report.form_m, bump_rms_m, 0.1 * bump_rms_m);
  EXPECT_NEAR(report.rms_m.median, std::hypot(bump_rms_m, across * kNoise_m), 0.1 * bump_rms_m);
  ASSERT_TRUE(report.expected_m);
  EXPECT_NEAR(report.expected_m->median, across * kNoise_m, 0.05 * kNoise_m);
  ASSERT_TRUE(report.noise_m);
  // A pixel between vertices is a mean of two or three of them.
  EXPECT_LT(*report.noise_m, kNoise_m);
  EXPECT_GT(*report.noise_m, 0.5 * kNoise_m);
  EXPECT_LT(report.size_m.deviation, 5e-5);
  EXPECT_NEAR(report.span_m.median, across * 2.4 * kBump_m, across * 0.3 * kBump_m);

  const Image8 picture = meter.picture(kBump_m * 3);
  ASSERT_EQ(picture.width(), kMiddle.width);
  ASSERT_EQ(picture.height(), kMiddle.height);
  // The wall before its mean is red. z grows by `bump`, so that is where it is below 0.
  const PinholeModel model = camera();
  int right = 0, asked = 0;
  for (int row = 10; row < kMiddle.height - 10; ++row) {
    for (int column = 10; column < kMiddle.width - 10; ++column) {
      const double x = (kMiddle.column + column - model.cx()) / model.fx();
      const double y = (kMiddle.row + row - model.cy()) / model.fy();
      const double bump = std::sin(60 * x) * std::sin(60 * y);
      if (std::fabs(bump) < 0.5) continue;
      ++asked;
      const std::uint8_t* rgb = picture.row(row) + 3 * static_cast<std::ptrdiff_t>(column);
      if ((rgb[0] > rgb[2]) == (bump < 0)) ++right;
    }
  }
  ASSERT_GT(asked, 500);
  EXPECT_GT(right, asked * 95 / 100);
}

TEST(ShapeMeter, WhatLiesBeforeTheWallIsOffItAndIsNotOfItsError) {
  test::Random random(4);
  ShapeMeter meter(camera(), kMiddle, ShapeKind::kPlane);
  ASSERT_TRUE(meter.add(seen([&](double x, double y) {
    const bool before = std::fabs(x) < 0.05 && std::fabs(y) < 0.04;
    return before ? 0.9F : static_cast<float>(wall(x)) + 1e-4F * normal(random);
  })));
  const ShapeReport report = meter.report();
  EXPECT_NEAR(report.off.median, 0.1 * 0.08 / (0.32 * 0.256), 0.02);
  EXPECT_NEAR(report.rms_m.median, 1e-4 * std::cos(20 * kDegree), 1e-5);
  EXPECT_GT(report.span_m.median, 0.09);  // all of it is there to see
}

TEST(ShapeMeter, FramesWithNothingThereAreCounted) {
  ShapeMeter meter(camera(), kMiddle, ShapeKind::kPlane);
  ASSERT_TRUE(meter.add(Frame3D{}));
  ASSERT_TRUE(meter.add(seen([](double x, double) { return static_cast<float>(wall(x)); })));
  Frame3D interpolated = seen([](double x, double) { return static_cast<float>(wall(x)); });
  interpolated.surface.interpolated.assign(interpolated.surface.positions.size(), 1);
  ASSERT_TRUE(meter.add(interpolated));
  EXPECT_EQ(meter.report().frames, 1U);
  EXPECT_EQ(meter.report().without_shape, 2U);
}

TEST(ShapeMeter, ABrokenSurfaceIsRefused) {
  ShapeMeter meter(camera(), kMiddle, ShapeKind::kPlane);
  Frame3D broken;
  broken.surface.positions = {{0, 0, 1}};
  broken.surface.triangles = {{0, 1, 2}};
  EXPECT_FALSE(meter.add(broken));
}

}  // namespace
}  // namespace relievo
