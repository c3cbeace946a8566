// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <random>

#include "capture/calibrate/point_cloud.h"
#include "capture/calibrate/ray_pairs.h"
#include "capture/reconstruct/triangulate.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::TempFolder;

std::vector<Vec3f> scatter(std::uint32_t seed, std::size_t count) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<float>(random()) / 4294967296.0f; };
  std::vector<Vec3f> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back({uniform(), uniform(), 0.1f * uniform()});
  return out;
}

TEST(PointCloud, NearestDistancesAreThoseOfASearchThroughAll) {
  const auto points = scatter(1, 300), reference = scatter(2, 1000);
  const auto nearest = nearest_distances(points, reference);
  for (std::size_t i = 0; i < points.size(); ++i) {
    float best = 1e9f;
    for (const Vec3f& r : reference) {
      best = std::min(best, std::hypot(points[i][0] - r[0], points[i][1] - r[1], points[i][2] - r[2]));
    }
    ASSERT_NEAR(nearest[i], best, 1e-6f);
  }
  EXPECT_TRUE(std::isinf(nearest_distances(points, {}).front()));
}

// Queries from afar could not tell parts of the cloud that are too far, and looked at all of it: hours for
// these.
TEST(PointCloud, CloudsFarApartTakeNoLonger) {
  constexpr std::size_t kMany = 200000;
  const auto reference = scatter(5, kMany);
  auto points = scatter(4, kMany);
  for (Vec3f& p : points) p = {1000 * p[0], 1000 * p[1], 1000 * p[2]};
  const auto nearest = nearest_distances(points, reference);
  for (std::size_t i = 0; i < kMany; i += kMany / 20) {
    float best = std::numeric_limits<float>::infinity();
    for (const Vec3f& r : reference) {
      best = std::min(best, std::hypot(points[i][0] - r[0], points[i][1] - r[1], points[i][2] - r[2]));
    }
    ASSERT_NEAR(nearest[i] / best, 1, 1e-6f);
  }
}

TEST(PointCloud, SpreadIsTheMedianDistanceFromTheMiddle) {
  EXPECT_EQ(spread_of({}), 0);
  EXPECT_EQ(spread_of({{5, 5, 5}}), 0);
  EXPECT_EQ(spread_of({{1, 0, 7}, {2, 0, 7}, {3, 0, 7}, {4, 0, 7}, {1000, 0, 7}}), 1);
}

TEST(PointCloud, PlyRoundTripAndAscii) {
  const TempFolder folder;
  PointCloud cloud{scatter(3, 50), {}};
  for (std::size_t i = 0; i < 50; ++i) cloud.colours.push_back({static_cast<std::uint8_t>(i), 2, 250});
  ASSERT_TRUE(write_ply_points(folder / "a.ply", cloud).ok());
  const auto read = read_ply_points(folder / "a.ply");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->positions, cloud.positions);
  EXPECT_EQ(read->colours, cloud.colours);

  std::ofstream(folder / "b.ply")
      << "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty float nx\n"
         "property float y\nproperty float z\nelement face 0\nend_header\n1.5 9 2.5 -3\n";
  const auto ascii = read_ply_points(folder / "b.ply");
  ASSERT_TRUE(ascii.ok()) << ascii.error().message;
  EXPECT_EQ(ascii->positions.at(0), (Vec3f{1.5f, 2.5f, -3}));
}

TEST(PointCloud, PointsThatAreNoneAreSkipped) {
  const TempFolder folder;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const PointCloud cloud{{{1, 2, 3}, {nan, nan, nan}, {4, 5, 6}}, {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}}};
  ASSERT_TRUE(write_ply_points(folder / "a.ply", cloud).ok());
  const auto read = read_ply_points(folder / "a.ply");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->positions, (std::vector<Vec3f>{{1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(read->colours, (std::vector<std::array<std::uint8_t, 3>>{{1, 1, 1}, {3, 3, 3}}));

  std::ofstream(folder / "b.ply") << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                                     "property float y\nproperty float z\nend_header\n"
                                     "1 2 3\nnan nan nan\n-nan -inf inf\n4 +5 6e0\n";
  const auto ascii = read_ply_points(folder / "b.ply");
  ASSERT_TRUE(ascii.ok()) << ascii.error().message;
  EXPECT_EQ(ascii->positions, read->positions);
}

TEST(PointCloud, APipeIsRefusedWithoutWaiting) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe.ply").c_str(), 0600), 0);
  EXPECT_THAT(read_ply_points(folder / "pipe.ply").error().message, testing::HasSubstr("it is a pipe"));
}

TEST(PointCloud, HostilePlyIsAnError) {
  const TempFolder folder;
  const auto refused = [&](const std::string& text) {
    std::ofstream(folder / "h.ply", std::ios::binary | std::ios::trunc) << text;
    const auto read = read_ply_points(folder / "h.ply");
    return read.ok() ? std::string("accepted") : read.error().message;
  };
  const std::string head = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n";
  EXPECT_THAT(refused(""), testing::HasSubstr("header"));
  EXPECT_THAT(refused("solid\n"), testing::HasSubstr("no PLY"));
  EXPECT_THAT(
      refused(head + "property float x\nproperty float y\nproperty float z\nend_header\n1234567890123"),
      testing::HasSubstr("ends after 1 of 4000000000 vertices"));
  EXPECT_THAT(refused("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
                      "property float z\nend_header\n1 2 3\n4 5 z\n"),
              testing::HasSubstr("ends after 1 of 2 vertices"));
  EXPECT_THAT(refused(head + "property list uchar int x\nend_header\n"), testing::HasSubstr("list"));
  EXPECT_THAT(refused(head + "property float x\nend_header\n"), testing::HasSubstr("no x, y, z"));
}

Rig small_rig() {
  Rig rig;
  rig.camera = {640, 480, {700, 0, 320, 0, 700, 240, 0, 0, 1}, {-0.1, 0.05, 0.001, -0.001, 0}};
  rig.projector = {1024, 768, {1400, 0, 510, 0, 1400, 800, 0, 0, 1}, {0.02, 0, 0, 0, 0}};
  rig.projector_from_camera_rotation = {std::cos(0.2),  0, std::sin(0.2), 0, 1, 0,
                                        -std::sin(0.2), 0, std::cos(0.2)};
  rig.projector_from_camera_translation = {-0.2, 0.1, 0.02};
  return rig;
}

TEST(RayPairs, AProjectedPointComesBack) {
  const Rig rig = small_rig();
  const Vec3f point = {0.05f, -0.03f, 0.9f};
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) {
    p[i] = r[3 * i] * double{point[0]} + r[3 * i + 1] * double{point[1]} + r[3 * i + 2] * double{point[2]} +
           t[i];
  }
  const auto camera = std::array{double{point[0] / point[2]}, double{point[1] / point[2]}};
  const auto met = meet(rig, camera, {p[0] / p[2], p[1] / p[2]});
  ASSERT_TRUE(met);
  EXPECT_LT(met->gap_m, 1e-6f);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(met->point[i], point[i], 1e-6f);

  // Off the epipolar plane by a pixel: the gap is a pixel at that distance.
  const auto off = meet(rig, camera, {p[0] / p[2], p[1] / p[2] + 1 / 1400.0});
  ASSERT_TRUE(off);
  EXPECT_NEAR(off->gap_m, p[2] / 1400, 1e-4);
}

TEST(RayPairs, WhatDoesNotMeetIsLeftOutAndCounted) {
  const Rig rig = small_rig();
  ImageF columns(640, 480, 1), rows(640, 480, 1);
  std::fill(columns.data(), columns.data() + columns.size(), -1.0f);
  std::fill(rows.data(), rows.data() + rows.size(), -1.0f);
  const auto set = [&](int x, int y, double row_off) {
    const auto ray = undistort(rig.camera, x, y);
    ASSERT_TRUE(ray);
    const auto& r = rig.projector_from_camera_rotation;
    const auto& t = rig.projector_from_camera_translation;
    const auto in = [&](std::size_t i) {
      return r[3 * i] * (*ray)[0] + r[3 * i + 1] * (*ray)[1] + r[3 * i + 2] + t[i];
    };
    const auto at = distort(rig.projector, in(0) / in(2), in(1) / in(2));
    columns.row(y)[x] = static_cast<float>(at[0]);
    rows.row(y)[x] = static_cast<float>(at[1] + row_off);
  };
  set(300, 200, 0);
  set(310, 210, 20);
  const DensePoints dense = triangulate_maps(rig, columns, rows, Image8(640, 480, 3), 0.005);
  ASSERT_EQ(dense.cloud.positions.size(), 1u);
  EXPECT_NEAR(dense.cloud.positions[0][2], 1, 1e-4);
  EXPECT_EQ(dense.apart, 1u);
}

}  // namespace
}  // namespace relievo
