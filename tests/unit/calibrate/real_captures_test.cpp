// SPDX-License-Identifier: Apache-2.0
// Real captures of other people's rigs, with the results that their programs reached.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "capture/calibrate/geometry.h"
#include "capture/calibrate/gray_stack.h"
#include "capture/calibrate/ray_pairs.h"
#include "capture/calibrate/rig_import.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

fs::path real(const std::string& name) {
  const char* set = std::getenv("RELIEVO_SHARED");
  const fs::path shared = set != nullptr ? fs::path(set) : fs::path(RELIEVO_SOURCE_DIR) / ".." / "shared";
  return shared / "real" / name;
}

double median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return double{*middle};
}

TEST(RealCaptures, ProcamStereoRmsAndPrincipalPoint) {
  const fs::path folder = real("procam");
  if (!fs::exists(folder)) GTEST_SKIP() << "no captures at " << folder << ": set RELIEVO_SHARED";
  const Board board{9, 7, 0.075};
  WorkerPool pool(2);
  std::vector<MeasuredView> views;
  for (int i = 0; i < 5; ++i) {
    const auto stack = read_gray_stack(folder / ("capture_" + std::to_string(i)), 1024, 768);
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    views.push_back(measure_view("capture_" + std::to_string(i), *stack, board, {}, pool));
    EXPECT_EQ(views.back().corners.size(), 63u) << views.back().refused;
  }
  PinholeModel camera, projector;
  camera.width = 1280;
  camera.height = 1024;
  projector.width = 1024;
  projector.height = 768;
  const auto geometry = calibrate_geometry(views, camera, projector, {});
  ASSERT_TRUE(geometry.ok()) << geometry.error().message;
  EXPECT_EQ(geometry->views, 5u);
  EXPECT_LE(geometry->stereo_rms, 0.25);      // 0.857 by the program that came with the captures
  EXPECT_LE(geometry->stereo_rms_all, 0.45);  // no corner left out
  EXPECT_NEAR(geometry->projector.cx(), 511.5, 60);
  EXPECT_GT(geometry->projector.cy(), 700);  // it throws upwards from about its picture's lower edge
  EXPECT_LT(geometry->projector.cy(), 1000);
  EXPECT_NEAR(geometry->projector.fx() / geometry->projector.fy(), 1, 0.01);
  EXPECT_LE(geometry->plane_rms_m, 0.0008);  // at 3.6 m
  EXPECT_LE(geometry->square_error_m, 0.0005);
}

TEST(RealCaptures, ShellWithItsPublishedCalibration) {
  const fs::path folder = real("shell");
  if (!fs::exists(folder)) GTEST_SKIP() << "no captures at " << folder << ": set RELIEVO_SHARED";
  const auto rig = import_rig(folder / "procam_2016_12_09.yaml", 0, 0);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  const auto stack = read_gray_stack(folder / "scan_0020", 1280, 800);
  ASSERT_TRUE(stack.ok()) << stack.error().message;
  WorkerPool pool(2);
  EXPECT_TRUE(flat_bits(*stack, {}).empty());
  const auto maps = decode_gray(*stack, {}, pool);
  ASSERT_TRUE(maps.ok()) << maps.error().message;
  const DensePoints dense = triangulate_maps(rig->rig, maps->columns, maps->rows, stack->picture, 0);
  EXPECT_GE(dense.cloud.positions.size(), 450000u);
  EXPECT_LE(median(dense.gap_m), 0.0002);
  auto reference = read_ply_points(folder / "scan_0020_cloud.ply");
  ASSERT_TRUE(reference.ok()) << reference.error().message;
  for (Vec3f& p : reference->positions)
    p = {0.001f * p[0], -0.001f * p[1], -0.001f * p[2]};  // y up, z backwards
  EXPECT_LE(median(nearest_distances(dense.cloud.positions, reference->positions)), 0.0006);
}

}  // namespace
}  // namespace relievo
