// SPDX-License-Identifier: Apache-2.0
// Calibration from the system's own stripes, along columns and along rows, against simulated truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "capture/calibrate/board_scene.h"
#include "capture/calibrate/compare_rigs.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/pattern/bcsl.h"
#include "capture/reconstruct/triangulate.h"
#include "tests/support/hung_up.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/calibrate/true_rig.h"

namespace relievo {
namespace {

using testing::HasSubstr;

const Board kBoard{9, 7, 0.025};

Rig coloured_truth() {
  Rig rig = truth();
  // The inverse of a camera's usual crosstalk, roughly.
  rig.colour_matrix = {1.19, -0.16, -0.03, -0.20, 1.34, -0.14, 0, -0.24, 1.24};
  return rig;
}

const CameraColours kNotKnown;

Pattern stripes(int count) {
  return *make_pattern(6, 2, 0, count);
}

/// Frames of an interlaced camera: even rows show the slide, odd ones the complement.
Image8 interlaced(const StripePair& pair) {
  Image8 out = pair.lit.clone();
  for (int y = 1; y < out.height(); y += 2) std::copy_n(pair.complement.row(y), out.stride(), out.row(y));
  return out;
}

StripeStack interlaced(const StripeStack& stack) {
  StripeStack out{stack.projector_width, stack.projector_height, stack.pattern, {}, {}};
  for (const StripePair& pair : stack.columns) out.columns.push_back(deinterlaced(interlaced(pair)));
  for (const StripePair& pair : stack.rows) out.rows.push_back(deinterlaced(interlaced(pair)));
  return out;
}

/// Where the projector sees what the camera sees at a point, by the board's true pose.
Vec2d projector_at(const Rig& rig, const Pose& camera_from_board, double x, double y) {
  const auto ray = undistort(rig.camera, x, y);
  const auto r = rotation_matrix(camera_from_board);
  const std::array<double, 3> t = {camera_from_board[3], camera_from_board[4], camera_from_board[5]};
  const std::array<double, 3> d = {(*ray)[0], (*ray)[1], 1};
  const auto along = [&](const std::array<double, 3>& v, std::size_t column) {
    return v[0] * r[column] + v[1] * r[3 + column] + v[2] * r[6 + column];
  };
  const double depth = along(t, 2) / along(d, 2);
  return project_board(rig.projector, compose(projector_pose(rig), camera_from_board),
                       {depth * along(d, 0) - along(t, 0), depth * along(d, 1) - along(t, 1)});
}

struct Quality {
  std::size_t edges = 0;
  double wrong = 0;   // share that is over 2 px off
  double rms_px = 0;  // of the others
};

Quality quality(const GrayEdges& edges, const Rig& rig, const Pose& pose, std::size_t axis) {
  Quality out{.edges = edges.edges.size()};
  double squares = 0, wrong = 0;
  for (const GrayEdge& e : edges.edges) {
    const double off = projector_at(rig, pose, double{e.x}, double{e.y})[axis] - double{e.value};
    if (std::fabs(off) > 2) {
      ++wrong;
    } else {
      squares += off * off;
    }
  }
  out.wrong = wrong / static_cast<double>(out.edges);
  out.rms_px = std::sqrt(squares / (static_cast<double>(out.edges) - wrong));
  return out;
}

TEST(Stripes, BoundariesOfBothAxesAreWhereTheBoardPutsThem) {
  const Rig rig = coloured_truth();
  const Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  const StripeStack whole = render_stripe_view(rig, kBoard, pose, stripes(64), 0.7, {.chroma = 1});
  WorkerPool pool(2);
  for (const bool halves : {false, true}) {
    const auto edges = halves ? decode_stripes(interlaced(whole), colours_of(rig), pool)
                              : decode_stripes(whole, colours_of(rig), pool);
    ASSERT_TRUE(edges.ok()) << edges.error().message;
    const Quality columns = quality(edges->columns, rig, pose, 0), rows = quality(edges->rows, rig, pose, 1);
    EXPECT_GT(columns.edges, 20000u);
    EXPECT_GT(rows.edges, 20000u);
    EXPECT_LT(columns.wrong, 0.001);
    EXPECT_LT(rows.wrong, 0.001);
    EXPECT_LT(columns.rms_px, 0.12);
    EXPECT_LT(rows.rms_px, 0.12);
  }
}

TEST(Stripes, SlidesMayComeInEitherOrder) {
  const Rig rig = coloured_truth();
  const Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  StripeStack stack = render_stripe_view(rig, kBoard, pose, stripes(64), 0.7, {});
  std::swap(stack.columns[0], stack.columns[1]);
  WorkerPool pool(2);
  const auto edges = decode_stripes(stack, colours_of(rig), pool);
  ASSERT_TRUE(edges.ok()) << edges.error().message;
  EXPECT_LT(quality(edges->columns, rig, pose, 0).wrong, 0.01);
}

TEST(Stripes, OneSlideIsEnoughForFewStripes) {
  const Rig rig = coloured_truth();
  const Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  const auto pattern = make_pattern(6, 1, 0, 30);
  ASSERT_TRUE(pattern.ok());
  WorkerPool pool(2);
  const auto edges =
      decode_stripes(render_stripe_view(rig, kBoard, pose, *pattern, 0.7, {}), colours_of(rig), pool);
  ASSERT_TRUE(edges.ok()) << edges.error().message;
  EXPECT_LT(quality(edges->columns, rig, pose, 0).wrong, 0.01);
  EXPECT_LT(quality(edges->rows, rig, pose, 1).wrong, 0.01);
}

/// Of six views, interlaced, with or without the colour matrix.
Geometry calibrated(const Rig& rig, bool interlaced_camera, const CameraColours& colours) {
  const auto poses = example_poses(rig, kBoard, 1.0, 6, 1);
  std::vector<MeasuredView> views;
  WorkerPool pool(2);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const StripeStack stack = render_stripe_view(rig, kBoard, poses[i], stripes(64), 0.7,
                                                 {.chroma = 1, .seed = static_cast<std::uint32_t>(i)});
    const std::string name = "view " + std::to_string(i);
    views.push_back(interlaced_camera ? measure_view(name, interlaced(stack), kBoard, colours, pool)
                                      : measure_view(name, stack, kBoard, colours, pool));
    EXPECT_EQ(views.back().refused, "");
  }
  auto geometry = calibrate(rig, views);
  EXPECT_TRUE(geometry.ok()) << geometry.error().message;
  return geometry.ok() ? *std::move(geometry) : Geometry{};
}

TEST(Stripes, ViewsGiveTheRigBack) {
  const Rig rig = coloured_truth();
  const Geometry geometry = calibrated(rig, false, colours_of(rig));
  EXPECT_EQ(geometry.views, 6u);
  EXPECT_GT(geometry.corners, 370u);
  EXPECT_LT(geometry.stereo_rms, 0.09);
  EXPECT_LT(geometry.plane_rms_m, 8e-5);
  const auto off = compare_rigs(rig_of(geometry), rig, 1.0);
  ASSERT_TRUE(off.ok()) << off.error().message;
  EXPECT_LT(off->camera_centre_px, 5);
  EXPECT_LT(off->projector_centre_px, 6);
  EXPECT_LT(off->depth_rms_m, 0.001);
}

TEST(Stripes, AProjectorMayHangFromTheCeiling) {
  const Rig rig = test::hung_up(coloured_truth());
  const Geometry geometry = calibrated(rig, false, colours_of(rig));
  EXPECT_EQ(geometry.views, 6u);
  EXPECT_LT(geometry.stereo_rms, 0.09);
  const auto off = compare_rigs(rig_of(geometry), rig, 1.0);
  ASSERT_TRUE(off.ok()) << off.error().message;
  EXPECT_LT(off->rotation_rad, 0.01);
  EXPECT_LT(off->depth_rms_m, 0.001);
}

TEST(Stripes, InterlacedViewsWithoutColourCalibrationAreGoodEnough) {
  const Rig rig = coloured_truth();
  const Geometry geometry = calibrated(rig, true, kNotKnown);
  EXPECT_EQ(geometry.views, 6u);
  EXPECT_LT(geometry.stereo_rms, 0.2);
  const auto off = compare_rigs(rig_of(geometry), rig, 1.0);
  ASSERT_TRUE(off.ok()) << off.error().message;
  EXPECT_LT(off->depth_rms_m, 0.002);
}

TEST(Stripes, RowPatternHasStripesOfTheSameWidth) {
  const Pattern columns = stripes(64), rows = row_pattern(columns, 1024, 768);
  EXPECT_EQ(rows.stripes(), 48);
  EXPECT_EQ(rows.sequence[47], columns.sequence[47]);
  EXPECT_EQ(row_pattern(columns, 768, 1024).stripes(), 64);  // no more than there are
}

TEST(StripeFolder, SlidesAsWrittenAreDecodedBack) {
  const test::TempFolder folder;
  const Pattern pattern = stripes(16);
  for (const Scan scan : {Scan::kProgressive, Scan::kInterlaced}) {
    const auto slides = folder / (scan == Scan::kProgressive ? "slides" : "frames");
    std::filesystem::create_directory(slides);
    ASSERT_TRUE(write_stripe_slides(slides, pattern, 320, 240, scan).ok());
    const auto stack = read_stripe_stack(slides, pattern, 320, 240);
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    WorkerPool pool(1);
    const auto edges = decode_stripes(*stack, kNotKnown, pool);
    ASSERT_TRUE(edges.ok()) << edges.error().message;
    EXPECT_GT(edges->columns.edges.size(), 2u * 15 * 230);
    // Beside a field's rows, what lies between them is interpolated: some edges there are given up.
    EXPECT_GT(edges->rows.edges.size(), 2u * 11 * (scan == Scan::kProgressive ? 310 : 240));
    for (const GrayEdge& e : edges->columns.edges) ASSERT_NEAR(e.x, e.value, 0.6);
    for (const GrayEdge& e : edges->rows.edges)
      ASSERT_NEAR(e.y, e.value, scan == Scan::kProgressive ? 0.6 : 1.1);
  }
}

TEST(StripeFolder, SlidesMayBeOnTheBottomFieldsRows) {
  const test::TempFolder folder;
  const Pattern pattern = stripes(16);
  const auto bottom = FieldOrder::kBottom;
  ASSERT_TRUE(write_stripe_slides(folder.path(), pattern, 320, 240, Scan::kInterlaced, bottom).ok());
  WorkerPool pool(1);
  const auto stack = read_stripe_stack(folder.path(), pattern, 320, 240, {.field_order = bottom});
  ASSERT_TRUE(stack.ok()) << stack.error().message;
  const auto edges = decode_stripes(*stack, kNotKnown, pool);
  ASSERT_TRUE(edges.ok()) << edges.error().message;
  for (const GrayEdge& e : edges->columns.edges) ASSERT_NEAR(e.x, e.value, 0.6);
  for (const GrayEdge& e : edges->rows.edges) ASSERT_NEAR(e.y, e.value, 1.1);
  const auto whole = draw_stripe_slides(pattern, 320, 240, Scan::kProgressive);
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  for (const int row : {1, 239}) {
    EXPECT_TRUE(std::equal(whole->at(0).row(row), whole->at(0).row(row) + 3 * 320,
                           stack->columns.at(0).lit.row(row)));
    EXPECT_TRUE(std::equal(whole->at(1).row(row - 1), whole->at(1).row(row - 1) + 3 * 320,
                           stack->columns.at(0).complement.row(row - 1)));
  }
}

TEST(StripeFolder, WrongFoldersAreRefused) {
  const test::TempFolder folder;
  const auto refusal = [&] {
    return read_stripe_stack(folder.path(), stripes(16), 320, 240).error().message;
  };
  EXPECT_THAT(refusal(), HasSubstr("has 0 pictures; stripes on 2 slides need 8"));
  ASSERT_TRUE(write_stripe_slides(folder.path(), stripes(16), 320, 240, Scan::kProgressive).ok());
  std::filesystem::remove(folder / "rows_slide2.png");
  EXPECT_THAT(refusal(), HasSubstr("has 7 pictures"));
  ASSERT_TRUE(write_png(folder / "rows_slide2.png", Image8(32, 24, 3)).ok());
  EXPECT_THAT(refusal(), HasSubstr("is of another size"));
  EXPECT_FALSE(write_stripe_slides(folder.path(), stripes(400), 320, 240, Scan::kProgressive).ok());
}

TEST(Stripes, DarkPicturesAreRefused) {
  StripeStack stack{1024, 768, stripes(64), {}, {}};
  for (int i = 0; i < 2; ++i) {
    stack.columns.push_back({Image8(64, 48, 3), Image8(64, 48, 3)});
    stack.rows.push_back({Image8(64, 48, 3), Image8(64, 48, 3)});
  }
  WorkerPool pool(1);
  EXPECT_THAT(decode_stripes(stack, kNotKnown, pool).error().message,
              HasSubstr("hardly any stripe along columns"));
  stack.rows.pop_back();
  EXPECT_THAT(decode_stripes(stack, kNotKnown, pool).error().message, HasSubstr("there must be 2 slides"));
}

/// Corners of a ChArUco board against its true pose.
TEST(Charuco, PartOfTheBoardIsEnough) {
  const Rig rig = coloured_truth();
  const Board board = *parse_board("charuco:12x9:25mm:18mm:5X5_100");
  WorkerPool pool(2);
  Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  for (const double left_m : {-0.42, 0.14}) {  // the camera sees 0.3 m to either side
    pose[3] = left_m;
    const StripeStack stack = render_stripe_view(rig, board, pose, stripes(64), 0.7, {});
    const MeasuredView view = measure_view("view", stack, board, colours_of(rig), pool);
    EXPECT_EQ(view.refused, "");
    EXPECT_GT(view.corners.size(), 20u);
    EXPECT_LT(view.corners.size(), 85u);  // of 88
    for (const CornerSight& c : view.corners) {
      const Vec2d camera = project_board(rig.camera, pose, c.board_m);
      const Vec2d projector = project_board(rig.projector, compose(projector_pose(rig), pose), c.board_m);
      EXPECT_NEAR(c.camera_px[0], camera[0], 0.3);
      EXPECT_NEAR(c.camera_px[1], camera[1], 0.3);
      EXPECT_NEAR(c.projector_px[0], projector[0], 0.6);
      EXPECT_NEAR(c.projector_px[1], projector[1], 0.6);
    }
  }
}

TEST(Charuco, AnotherDictionaryIsNotTheBoard) {
  const Rig rig = coloured_truth();
  const Pose pose = example_poses(rig, kBoard, 1.0, 1, 1).at(0);
  WorkerPool pool(2);
  const StripeStack stack =
      render_stripe_view(rig, *parse_board("charuco:10x8:25mm:18mm:5X5_100"), pose, stripes(64), 0.7, {});
  const MeasuredView view =
      measure_view("view", stack, *parse_board("charuco:10x8:25mm:18mm:6X6_50"), colours_of(rig), pool);
  EXPECT_THAT(view.refused, HasSubstr("is it the board and the dictionary given?"));
}

}  // namespace
}  // namespace relievo
