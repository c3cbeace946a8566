// SPDX-License-Identifier: Apache-2.0
// Geometric calibration of simulated rigs, against their truth.
#include "capture/calibrate/geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "capture/calibrate/board_scene.h"
#include "capture/calibrate/compare_rigs.h"
#include "capture/calibrate/plane_check.h"
#include "capture/pattern/gray_code.h"
#include "tests/unit/calibrate/true_rig.h"

namespace relievo {
namespace {

using testing::HasSubstr;

const Board kBoard{9, 7, 0.025};

GrayStack stack_of(const Rig& rig, const std::vector<Image8>& pictures) {
  GrayStack stack;
  stack.projector_width = rig.projector.width;
  stack.projector_height = rig.projector.height;
  stack.columns.resize(static_cast<std::size_t>(gray_bits(rig.projector.width)));
  stack.rows.resize(static_cast<std::size_t>(gray_bits(rig.projector.height)));
  stack.picture = Image8(rig.camera.width, rig.camera.height, 3);
  const auto slides = gray_slides(rig.projector.width, rig.projector.height);
  for (std::size_t i = 0; i < slides.size(); ++i) {
    if (slides[i].kind != GraySlide::Kind::kBit) continue;
    auto& pairs = slides[i].axis == GrayAxis::kColumns ? stack.columns : stack.rows;
    GrayPair& pair = pairs[static_cast<std::size_t>(slides[i].bit)];
    (slides[i].inverse ? pair.inverse : pair.lit) = pictures[i].clone();
  }
  return stack;
}

Pose pose_between(const Rig& rig) {
  const auto& r = rig.projector_from_camera_rotation;
  const double angle = std::acos((r[0] + r[4] + r[8] - 1) / 2);
  const double scale = angle / (2 * std::sin(angle));
  const auto& t = rig.projector_from_camera_translation;
  return {scale * (r[7] - r[5]), scale * (r[2] - r[6]), scale * (r[3] - r[1]), t[0], t[1], t[2]};
}

/// Corners as ideal devices would see them, with noise: no pictures.
std::vector<MeasuredView> ideal_views(const Rig& rig, int count, double noise_px) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, noise_px);
  const Pose between = pose_between(rig);
  std::vector<MeasuredView> views;
  for (const Pose& pose : example_poses(rig, kBoard, 1.0, count, 3)) {
    MeasuredView& view = views.emplace_back(MeasuredView{.name = "view " + std::to_string(views.size())});
    for (int i = 0; i < kBoard.corners(); ++i) {
      const Vec2d c = project_board(rig.camera, pose, kBoard.corner_m(i));
      const Vec2d p = project_board(rig.projector, compose(between, pose), kBoard.corner_m(i));
      view.corners.push_back({kBoard.corner_m(i),
                              {c[0] + normal(random), c[1] + normal(random)},
                              {p[0] + normal(random), p[1] + normal(random)}});
    }
  }
  return views;
}

TEST(Geometry, RenderedViewsGiveTheRigBack) {
  const Rig rig = truth();
  const auto poses = example_poses(rig, kBoard, 1.0, 6, 1);
  ASSERT_EQ(poses.size(), 6u);
  std::vector<MeasuredView> views;
  WorkerPool pool(2);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto pictures = render_gray_view(rig, kBoard, poses[i], {.seed = static_cast<std::uint32_t>(i)});
    views.push_back(measure_view("view " + std::to_string(i), stack_of(rig, pictures), kBoard, {}, pool));
    EXPECT_EQ(views.back().refused, "");
  }
  const auto geometry = calibrate(rig, views);
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_EQ(geometry->views, 6u);
  EXPECT_LT(geometry->stereo_rms, 0.12);
  EXPECT_LT(geometry->plane_rms_m, 5e-5);
  const auto off = compare_rigs(rig_of(*geometry), rig, 1.0);
  ASSERT_TRUE(off.ok()) << off.error().message;
  EXPECT_LT(off->camera_focal, 0.003);
  EXPECT_LT(off->projector_focal, 0.003);
  EXPECT_LT(off->camera_centre_px, 8);
  EXPECT_LT(off->projector_centre_px, 10);
  EXPECT_LT(off->baseline_m, 0.002);
  EXPECT_LT(off->depth_rms_m, 0.0015);
}

TEST(Geometry, IdealCornersGiveTheRigBackWithinItsOwnSigmas) {
  const Rig rig = truth();
  const auto geometry = calibrate(rig, ideal_views(rig, 12, 0.05));
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_NEAR(geometry->stereo_rms, 0.05 * std::numbers::sqrt2, 0.01);
  const std::array<double, 8> found = {
      geometry->camera.fx(),    geometry->camera.fy(),    geometry->camera.cx(),    geometry->camera.cy(),
      geometry->projector.fx(), geometry->projector.fy(), geometry->projector.cx(), geometry->projector.cy()};
  const std::array<double, 8> true_values = {rig.camera.fx(),    rig.camera.fy(),    rig.camera.cx(),
                                             rig.camera.cy(),    rig.projector.fx(), rig.projector.fy(),
                                             rig.projector.cx(), rig.projector.cy()};
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_LT(std::fabs(found[i] - true_values[i]), 4 * geometry->sigma_px[i]) << i;
    EXPECT_LT(geometry->sigma_px[i], 4) << i;
  }
  EXPECT_LT(compare_rigs(rig_of(*geometry), rig, 1.0)->depth_rms_m, 0.0004);
}

// Few views fit a wrong rig as well as the right one: what they leave open is told by itself.
TEST(Geometry, HowWellDepthsAreKnownIsTold) {
  const Rig rig = truth();
  const auto many = calibrate(rig, ideal_views(rig, 12, 0.05));
  ASSERT_TRUE(many.ok()) << many.error().message;
  EXPECT_LT(many->depth_sigma_m, kGoodDepthSigma * many->distance_m);
  double squares = 0;
  const std::vector<MeasuredView> views = ideal_views(rig, 12, 0.05);
  for (std::size_t first = 0; first < 12; first += 3) {
    const auto few = calibrate(rig, {views.begin() + static_cast<std::ptrdiff_t>(first),
                                     views.begin() + static_cast<std::ptrdiff_t>(first) + 3});
    ASSERT_TRUE(few.ok()) << few.error().message;
    EXPECT_GT(few->depth_sigma_m, 1.5 * many->depth_sigma_m) << first;
    const double off = compare_rigs(rig_of(*few), rig, few->distance_m)->depth_rms_m;
    EXPECT_LT(off, 3 * few->depth_sigma_m) << first;
    squares += (off / few->depth_sigma_m) * (off / few->depth_sigma_m);
  }
  EXPECT_GT(std::sqrt(squares / 4), 0.2);
}

TEST(Geometry, EightTimesTheSamePoseIsNoCalibration) {
  const Rig rig = truth();
  const std::vector<MeasuredView> views(8, ideal_views(rig, 1, 0.05).front());
  const auto geometry = calibrate(rig, views);
  ASSERT_FALSE(geometry.ok()) << geometry->depth_sigma_m << " m, " << geometry->stereo_rms << " px";
  EXPECT_THAT(geometry.error().message, HasSubstr("tilted in different directions"));
}

TEST(Geometry, ABoardThatLooksTooLargeIsAScaleError) {
  const Rig rig = truth();
  const auto geometry = calibrate(rig, ideal_views(rig, 12, 0.05));
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_GT(geometry->scale_error, 0);
  EXPECT_LT(geometry->scale_error, 3e-4);
  for (const double baseline : {1.01, 0.99}) {  // the depth of all goes with it
    std::vector<PlaneCheck> checks;
    for (const MeasuredView& measured : ideal_views(rig, 4, 0)) {
      Pose pose = pose_between(rig);
      for (std::size_t i = 3; i < 6; ++i) pose[i] *= baseline;
      checks.push_back(check_plane(rig_of(Devices{rig.camera, rig.projector, pose}),
                                   {.corners = measured.corners, .camera_from_board = {}}));
      EXPECT_NEAR(checks.back().scale_error, baseline - 1, 1e-6);
    }
    EXPECT_NEAR(together(checks).scale_error, 0.01, 1e-6);
  }
}

TEST(Geometry, WhatItFoundGoesIntoTheRig) {
  const Rig rig = truth();
  const auto geometry = calibrate(rig, ideal_views(rig, 12, 0.05));
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  const Rig found = with_geometry(rig, *geometry);
  EXPECT_EQ(found.camera.matrix, geometry->camera.matrix);
  EXPECT_EQ(found.stereo_rms_px, geometry->stereo_rms);
  EXPECT_GT(found.scale_error, geometry->scale_error);
  EXPECT_EQ(found.scale_error,
            std::hypot(geometry->scale_error, geometry->depth_sigma_m / geometry->distance_m));
  EXPECT_EQ(found.colour_matrix, rig.colour_matrix);
}

TEST(Geometry, ABadViewIsNamedAndLeftOut) {
  const Rig rig = truth();
  auto views = ideal_views(rig, 8, 0.05);
  for (std::size_t i = 0; i < views[5].corners.size(); ++i) {  // the board moved between the pictures
    views[5].corners[i].projector_px[0] += 3 + 0.05 * static_cast<double>(i);
  }
  const auto geometry = calibrate(rig, views);
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  for (std::size_t v = 0; v < views.size(); ++v)
    EXPECT_EQ(geometry->reports[v].used, v != 5) << geometry->reports[v].why;
  EXPECT_NE(geometry->reports[5].why, "");
  EXPECT_LT(geometry->stereo_rms, 0.1);
}

// Too little off for a corner to be left out, and enough to shift depths by a millimetre.
TEST(Geometry, AViewWithAPictureOfAnotherPoseIsLeftOutOfCleanOnes) {
  const Rig rig = truth();
  auto views = ideal_views(rig, 8, 0.02);
  for (std::size_t i = 0; i < views[2].corners.size(); ++i)
    views[2].corners[i].projector_px[1] += i % 2 == 0 ? 0.25 : -0.25;
  const auto geometry = calibrate(rig, views);
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  for (std::size_t v = 0; v < views.size(); ++v)
    EXPECT_EQ(geometry->reports[v].used, v != 2) << geometry->reports[v].why;
  EXPECT_NE(geometry->reports[2].why.find("of one pose"), std::string::npos) << geometry->reports[2].why;
}

TEST(Geometry, BadCornersAreLeftOut) {
  const Rig rig = truth();
  auto views = ideal_views(rig, 6, 0.05);
  for (std::size_t v = 0; v < views.size(); ++v) {
    views[v].corners[10 + v].projector_px[1] += 4;
    views[v].corners[30 + v].camera_px[0] -= 3;
  }
  const auto geometry = calibrate(rig, views);
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_EQ(geometry->views, 6u);
  EXPECT_EQ(geometry->corners, 6u * 61u);
  for (const ViewReport& r : geometry->reports) EXPECT_EQ(r.corners_left_out, 2u) << r.name;
  EXPECT_GT(geometry->stereo_rms_all, 2 * geometry->stereo_rms);
}

TEST(Geometry, TooFewViewsSayWhy) {
  const Rig rig = truth();
  auto views = ideal_views(rig, 4, 0.05);
  views[1].refused = "the whole board is not seen in the pictures";
  views[2].refused = "only 3 of 63 corners could be decoded";
  const auto geometry = calibrate(rig, views);
  ASSERT_FALSE(geometry.ok());
  // Those views' reasons are the caller's, who has told them.
  EXPECT_EQ(geometry.error().message, "2 of 4 views can be used, at least 3 are needed");
}

TEST(Geometry, ViewsThatNoRigFitsAreRefused) {
  const Rig rig = truth();
  const auto geometry = calibrate(rig, ideal_views(rig, 6, 8));
  ASSERT_FALSE(geometry.ok());
  EXPECT_NE(geometry.error().message.find("no rig fits the views"), std::string::npos)
      << geometry.error().message;
}

TEST(Geometry, FewFlatViewsStayInsideReason) {
  const Rig rig = truth();
  auto views = ideal_views(rig, 3, 0.2);
  const auto geometry = calibrate(rig, views);
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_GT(geometry->projector.cy(), -0.5 * rig.projector.height);
  EXPECT_LT(geometry->projector.cy(), 1.5 * rig.projector.height);
  EXPECT_NEAR(geometry->projector.cx(), rig.projector.width / 2.0, 0.25 * rig.projector.width);
  EXPECT_NEAR(geometry->projector.fx() / geometry->projector.fy(), 1, 0.01);
  EXPECT_LT(geometry->stereo_rms, 0.3);
}

TEST(Geometry, LensShiftUpOrDownIsFound) {
  for (const double cy : {-120.0, 299.5, 720.0}) {
    Rig rig = truth();
    rig.projector.matrix[5] = cy;
    // The same picture on the board, whatever the lens shift: the projector is turned the other way.
    const double b = std::atan((cy - 299.5) / rig.projector.fy()), a = 0.2;
    const double c = std::cos(b), s = std::sin(b);
    const std::array<double, 9> y = {std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a)};
    rig.projector_from_camera_rotation = {y[0],      0, y[2],       //
                                          -s * y[6], c, -s * y[8],  //
                                          c * y[6],  s, c * y[8]};
    const auto geometry = calibrate(rig, ideal_views(rig, 5, 0.1));
    ASSERT_TRUE(geometry.ok()) << geometry.error().message;
    EXPECT_NEAR(geometry->projector.cy(), cy, 25);
    EXPECT_LT(geometry->stereo_rms, 0.16);
  }
}

TEST(Geometry, ViewWithoutBoardIsRefused) {
  const Rig rig = truth();
  const auto poses = example_poses(rig, kBoard, 1.0, 1, 1);
  ASSERT_EQ(poses.size(), 1u);
  const auto pictures = render_gray_view(rig, kBoard, poses[0], {});
  WorkerPool pool(2);
  const Board larger{10, 8, 0.025};
  const auto view = measure_view("v", stack_of(rig, pictures), larger, {}, pool);
  EXPECT_THAT(view.refused, HasSubstr("the whole board is not seen"));
}

TEST(Geometry, DimPicturesAreMeasuredToo) {
  const Rig rig = truth();
  const Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  std::vector<Image8> pictures = render_gray_view(rig, kBoard, pose, {.noise = 0.5});
  for (Image8& picture : pictures) {
    for (std::size_t i = 0; i < picture.size(); ++i) picture.data()[i] /= 6;
  }
  WorkerPool pool(2);
  const auto view = measure_view("v", stack_of(rig, pictures), kBoard, {}, pool);
  EXPECT_EQ(view.refused, "");
  EXPECT_GE(view.corners.size(), 60u);
}

TEST(Geometry, ResidualPictureIsDrawn) {
  const Rig rig = truth();
  const auto geometry = calibrate(rig, ideal_views(rig, 4, 0.1));
  ASSERT_TRUE(geometry.ok());
  const Image8 picture = draw_residuals(*geometry);
  EXPECT_EQ(picture.channels(), 3);
  std::size_t bright = 0;
  for (std::size_t i = 0; i < picture.size(); ++i) bright += picture.data()[i] > 100;
  EXPECT_GT(bright, geometry->residuals.size() * 10);
}

TEST(Board, ParsesAndRefuses) {
  const auto board = parse_board("chessboard:9x7:75mm");
  ASSERT_TRUE(board.ok());
  EXPECT_EQ(board->columns, 9);
  EXPECT_EQ(board->rows, 7);
  EXPECT_NEAR(board->square_m, 0.075, 1e-12);
  EXPECT_NEAR(parse_board("chessboard:4x3:2.5cm")->square_m, 0.025, 1e-12);
  for (const char* wrong :
       {"", "chessboard", "chessboard:9x7", "chessboard:9x7:75", "chessboard:2x7:75mm", "chessboard:9x7:0mm",
        "chessboard:9x7:1.2.3mm", "chessboard:9x7:.mm", "chessboard:9x7:9999999m", "charuco:9x7:30mm",
        "charuco:9x7:30mm:30mm", "charuco:2x7:30mm:20mm", "charuco:9x7:30mm:20mm:8X8_50",
        "charuco:20x20:30mm:20mm"}) {
    EXPECT_FALSE(parse_board(wrong).ok()) << wrong;
  }
  // A unit that was mistyped.
  for (const char* wrong : {"chessboard:9x7:25m", "chessboard:9x7:0.025mm", "charuco:10x8:30m:22mm"})
    EXPECT_THAT(parse_board(wrong).error().message, HasSubstr("is its unit right?")) << wrong;
  const auto charuco = parse_board("charuco:10x8:30mm:2.2cm:DICT_5X5_100");
  ASSERT_TRUE(charuco.ok());
  EXPECT_TRUE(charuco->charuco());
  EXPECT_EQ(charuco->corners(), 63);  // of 10 x 8 squares
  EXPECT_NEAR(charuco->marker_m, 0.022, 1e-12);
  EXPECT_EQ(parse_board("charuco:10x8:30mm:22mm:5X5_100")->dictionary, charuco->dictionary);
  EXPECT_EQ(parse_board("charuco:10x8:30mm:22mm")->dictionary, "DICT_4X4_50");
  EXPECT_THAT(parse_board("charuco:20x20:30mm:20mm").error().message, HasSubstr("use a larger dictionary"));
}

}  // namespace
}  // namespace relievo
