// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "client/shot/render.h"

namespace relievo {
namespace {

constexpr int kWidth = 160, kHeight = 120;

PinholeModel camera() {
  PinholeModel model;
  model.width = kWidth;
  model.height = kHeight;
  model.matrix = {150, 0, 79.5, 0, 150, 59.5, 0, 0, 1};
  return model;
}

/// A square that faces the camera: its corners' pixels in the camera's picture, at a depth.
void add_square(Frame3D& frame, float left, float top, float right, float bottom, float z) {
  const PinholeModel model = camera();
  const auto first = static_cast<std::uint32_t>(frame.surface.positions.size());
  for (const auto& [x, y] : {std::pair{left, top}, {right, top}, {right, bottom}, {left, bottom}}) {
    frame.surface.positions.push_back({static_cast<float>((x - model.cx()) / model.fx()) * z,
                                       static_cast<float>((y - model.cy()) / model.fy()) * z, z});
    frame.surface.texture_coordinates.push_back({x / kWidth, y / kHeight});
    frame.surface.normals.push_back({0, 0, -1});
  }
  frame.surface.triangles.push_back({first, first + 3, first + 2});
  frame.surface.triangles.push_back({first, first + 2, first + 1});
}

/// Red on the left half, green on the right.
Image8 halves() {
  Image8 texture(kWidth, kHeight, 3);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) texture.row(y)[3 * x + (x < kWidth / 2 ? 0 : 1)] = 255;
  return texture;
}

Rgba at(const Image8& picture, int x, int y) {
  const std::uint8_t* p = picture.row(y) + static_cast<std::ptrdiff_t>(x) * 4;
  return {p[0], p[1], p[2], p[3]};
}

const Rgba kNothing{0, 0, 0, 0};

TEST(Shot, RigViewDrawsEachPlaceWhereTheCameraSawIt) {
  Frame3D frame;
  add_square(frame, 30, 20, 130, 100, 1.5F);
  frame.texture = halves();
  const Image8 picture = render(frame, rig_view(camera(), kWidth, kHeight), {});
  ASSERT_EQ(picture.width(), kWidth);
  ASSERT_EQ(picture.channels(), 4);
  EXPECT_EQ(at(picture, 27, 60), kNothing);
  EXPECT_EQ(at(picture, 80, 17), kNothing);
  EXPECT_EQ(at(picture, 133, 60), kNothing);
  EXPECT_EQ(at(picture, 33, 60), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(at(picture, 127, 97), (Rgba{0, 255, 0, 255}));
  EXPECT_EQ(at(picture, 77, 60), (Rgba{255, 0, 0, 255}));
  EXPECT_EQ(at(picture, 83, 60), (Rgba{0, 255, 0, 255}));
  // Twice as large: each place at twice its pixel, seen from the picture's corner.
  const Image8 large = render(frame, rig_view(camera(), 2 * kWidth, 2 * kHeight), {});
  EXPECT_EQ(at(large, 55, 120), kNothing);
  EXPECT_EQ(at(large, 66, 120), (Rgba{255, 0, 0, 255}));
}

TEST(Shot, WhatIsNearerHidesWhatLiesBehindInAnyOrder) {
  for (const bool near_first : {false, true}) {
    Frame3D frame;
    for (const bool near : {near_first, !near_first})
      near ? add_square(frame, 60, 40, 100, 80, 1) : add_square(frame, 20, 20, 140, 100, 2);
    const RenderOptions options{.mode = ShotMode::kDepth, .depth = {1, 2}};
    const Image8 picture = render(frame, rig_view(camera(), kWidth, kHeight), options);
    EXPECT_EQ(at(picture, 80, 60), (Rgba{253, 231, 37, 255})) << near_first;  // near: yellow
    EXPECT_EQ(at(picture, 30, 60), (Rgba{68, 1, 84, 255})) << near_first;     // far: violet
  }
}

TEST(Shot, DepthGoesLinearlyAcrossASlantedSurface) {
  Frame3D frame;
  // A plane from 1 m on the left to 2 m on the right: 1/z is linear in the picture.
  frame.surface.positions = {{-0.5F, -0.4F, 1}, {1, -0.8F, 2}, {1, 0.8F, 2}, {-0.5F, 0.4F, 1}};
  frame.surface.normals.assign(4, {0, 0, -1});
  frame.surface.triangles = {{0, 3, 2}, {0, 2, 1}};
  const RenderOptions options{.mode = ShotMode::kDepth, .depth = {1, 2}, .samples = 1};
  const Image8 picture = render(frame, rig_view(camera(), kWidth, kHeight), options);
  // In the middle of the picture x = 0: a third of the way, z = 4/3 m; stop 7/3 of the palette.
  const Rgba there = at(picture, 80, 60);
  EXPECT_NEAR(there[0], 74 + (31 - 74) / 3.0, 3);
  EXPECT_NEAR(there[1], 193 + (161 - 193) / 3.0, 3);
  EXPECT_NEAR(there[2], 109 + (135 - 109) / 3.0, 3);
}

TEST(Shot, OrbitHasAllOfTheSurfaceInThePictureFromAnywhere) {
  Frame3D frame;
  add_square(frame, 20, 20, 140, 100, 1);
  add_square(frame, 60, 40, 100, 80, 1.4F);
  const Extent extent = extent_of(frame.surface.positions);
  for (const double azimuth : {-170.0, -40.0, 0.0, 16.0, 75.0}) {
    for (const double elevation : {-60.0, 0.0, 13.0, 80.0}) {
      const ShotView view =
          orbit_view(extent, {.azimuth_deg = azimuth, .elevation_deg = elevation}, kWidth, kHeight);
      for (const Vec3f& position : frame.surface.positions) {
        const Vec3f p = view.to_view(position);
        ASSERT_GT(p[2], 0);
        const double x = view.lens.fx() * p[0] / p[2] + view.lens.cx();
        const double y = view.lens.fy() * p[1] / p[2] + view.lens.cy();
        EXPECT_TRUE(x > 0 && x < kWidth && y > 0 && y < kHeight)
            << azimuth << ' ' << elevation << ": " << x << ' ' << y;
      }
    }
  }
}

TEST(Shot, OrbitsAzimuthIsToTheRightAndItsElevationAbove) {
  const Extent extent{{-1, -1, 2}, {1, 1, 4}};
  const ShotView front = orbit_view(extent, {.azimuth_deg = 0, .elevation_deg = 0}, kWidth, kHeight);
  EXPECT_NEAR(front.eye[0], 0, 1e-5);
  EXPECT_NEAR(front.eye[1], 0, 1e-5);
  EXPECT_LT(front.eye[2], 2);
  EXPECT_NEAR(front.to_view({0.5F, 0, 3})[0], 0.5F, 1e-5);  // right stays right
  const ShotView aside = orbit_view(extent, {.azimuth_deg = 30, .elevation_deg = 20}, kWidth, kHeight);
  EXPECT_GT(aside.eye[0], 0.5F);
  EXPECT_LT(aside.eye[1], -0.5F);  // y is down
  const Vec3f middle = aside.to_view({0, 0, 3});
  EXPECT_NEAR(middle[0], 0, 1e-4);
  EXPECT_NEAR(middle[1], 0, 1e-4);
  // The axes are those of a camera: unit, square, right-handed.
  const auto& [r, d, f] = aside.axes;
  EXPECT_NEAR(r[1] * d[2] - r[2] * d[1], f[0], 1e-5);
  EXPECT_NEAR(r[2] * d[0] - r[0] * d[2], f[1], 1e-5);
  EXPECT_NEAR(r[0] * d[1] - r[1] * d[0], f[2], 1e-5);
}

TEST(Shot, EveryModeDrawsAndConfidenceTellsExactFromRough) {
  Frame3D frame;
  add_square(frame, 20, 20, 78, 100, 1);
  add_square(frame, 82, 20, 140, 100, 1);
  frame.texture = halves();
  frame.surface.sigmas_m = {10e-6F, 10e-6F, 10e-6F, 10e-6F, 5e-3F, 5e-3F, 5e-3F, 5e-3F};
  const ShotView view = rig_view(camera(), kWidth, kHeight);
  for (const char* name : {"textured", "shaded", "wire", "points", "normals", "depth", "confidence"}) {
    const auto mode = shot_mode_named(name);
    ASSERT_TRUE(mode) << name;
    const Image8 picture = render(frame, view, {.mode = *mode, .depth = {0.5F, 1.5F}});
    const Image8 empty = render(Frame3D(), view, {.mode = *mode, .depth = {0.5F, 1.5F}});
    EXPECT_NE(at(picture, 20, 20), kNothing) << name;
    EXPECT_EQ(at(picture, 80, 60), kNothing) << name;
    EXPECT_EQ(at(empty, 20, 20), kNothing) << name;
  }
  const Image8 confidence = render(frame, view, {.mode = ShotMode::kConfidence});
  EXPECT_GT(at(confidence, 50, 60)[1], at(confidence, 50, 60)[0]);    // green
  EXPECT_GT(at(confidence, 110, 60)[0], at(confidence, 110, 60)[1]);  // red
  const Image8 normals = render(frame, view, {.mode = ShotMode::kNormals});
  EXPECT_EQ(at(normals, 50, 60)[2], 255);  // to the camera
  EXPECT_FALSE(shot_mode_named("pretty"));
}

TEST(Shot, WhatIsBehindTheEyeOrNoNumberIsNotDrawn) {
  Frame3D frame;
  add_square(frame, 20, 20, 140, 100, 1);
  frame.surface.positions[0][2] = -1;
  frame.surface.positions[1][0] = std::numeric_limits<float>::quiet_NaN();
  for (const ShotMode mode : {ShotMode::kShaded, ShotMode::kWire, ShotMode::kPoints}) {
    const Image8 picture = render(frame, rig_view(camera(), kWidth, kHeight), {.mode = mode});
    EXPECT_EQ(at(picture, 80, 60), kNothing);
  }
}

}  // namespace
}  // namespace relievo
