// SPDX-License-Identifier: Apache-2.0
#include "codec/frame3d_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "tests/support/make_surface.h"

namespace relievo {
namespace {

constexpr Volume kVolume{{-1, -1, 0}, 2};

Frame3D decoded(const Frame3D& frame, const EncodeOptions& options) {
  const auto bytes = encode_frame(frame, options);
  EXPECT_TRUE(bytes.ok()) << (bytes ? "" : bytes.error().message);
  auto back = decode_frame(*bytes);
  EXPECT_TRUE(back.ok()) << (back ? "" : back.error().message);
  return std::move(*back);
}

double distance(const Vec3f& a, const Vec3f& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// Index of the nearest vertex of `surface`, found by texture coordinates that name each vertex.
std::uint32_t column_row(const Vec2f& uv, int columns, int rows) {
  const int c = std::clamp(static_cast<int>(uv[0] * static_cast<float>(columns)), 0, columns - 1);
  const int r = std::clamp(static_cast<int>(uv[1] * static_cast<float>(rows)), 0, rows - 1);
  return static_cast<std::uint32_t>(r * columns + c);
}

struct Case {
  int position_bits;
  int speed;
  int normal_bits;
};
class RoundTrip : public testing::TestWithParam<Case> {};

TEST_P(RoundTrip, EveryVertexAndTriangleComesBackWithinHalfAStep) {
  constexpr int kColumns = 40;
  constexpr int kRows = 50;
  Frame3D frame = test::frame(kColumns, kRows);
  if (GetParam().normal_bits > 0)
    frame.surface.normals.assign(frame.surface.positions.size(), Vec3f{0, 0, -1});
  EncodeOptions options;
  options.position_bits = GetParam().position_bits;
  options.draco_speed = GetParam().speed;
  options.normal_bits = GetParam().normal_bits;
  options.volume = kVolume;
  const Frame3D back = decoded(frame, options);
  EXPECT_EQ(back.number, frame.number);
  EXPECT_EQ(back.time_ns, frame.time_ns);

  std::set<std::uint32_t> used;
  for (const Triangle& t : frame.surface.triangles) used.insert(t.begin(), t.end());
  ASSERT_EQ(back.surface.positions.size(), used.size());
  ASSERT_EQ(back.surface.texture_coordinates.size(), used.size());
  ASSERT_EQ(back.surface.normals.size(), GetParam().normal_bits > 0 ? used.size() : 0u);

  const double half_step = 0.5 * kVolume.size_m / ((1 << options.position_bits) - 1) + 1e-6;
  std::vector<std::uint32_t> original;
  for (std::size_t i = 0; i < back.surface.positions.size(); ++i) {
    const std::uint32_t from = column_row(back.surface.texture_coordinates[i], kColumns, kRows);
    original.push_back(from);
    EXPECT_EQ(used.erase(from), 1u) << "vertex " << from << " came twice or was not sent";
    for (std::size_t k = 0; k < 3; ++k)
      ASSERT_NEAR(back.surface.positions[i][k], frame.surface.positions[from][k], half_step);
    if (GetParam().normal_bits > 0) {
      ASSERT_NEAR(distance(back.surface.normals[i], {0, 0, -1}), 0, 0.05);
    }
  }
  EXPECT_TRUE(used.empty());

  const auto turned = [](Triangle t) {  // same orientation, smallest index first
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
  };
  std::multiset<Triangle> sent;
  std::multiset<Triangle> received;
  for (const Triangle& t : frame.surface.triangles) sent.insert(turned(t));
  for (const Triangle& t : back.surface.triangles)
    received.insert(turned({original[t[0]], original[t[1]], original[t[2]]}));
  EXPECT_EQ(sent, received);
}

INSTANTIATE_TEST_SUITE_P(Options, RoundTrip,
                         testing::Values(Case{12, 0, 0}, Case{12, 3, 0}, Case{12, 5, 0}, Case{12, 7, 0},
                                         Case{12, 9, 0}, Case{8, 5, 0}, Case{16, 5, 0}, Case{20, 5, 0},
                                         Case{12, 5, 8}, Case{12, 9, 10}));

TEST(FrameCodec, SaysWhatItHoldsWithoutDecoding) {
  const Frame3D frame = test::frame(20, 30, 80, 60);
  EncodeOptions options;
  options.volume = kVolume;
  const auto bytes = encode_frame(frame, options);
  ASSERT_TRUE(bytes.ok());
  const auto header = read_frame_header(*bytes);
  ASSERT_TRUE(header.ok()) << header.error().message;
  EXPECT_EQ(header->version, 1);
  EXPECT_EQ(header->number, 42u);
  EXPECT_EQ(header->time_ns, frame.time_ns);
  EXPECT_EQ(header->triangles, frame.surface.triangles.size());
  EXPECT_GT(header->vertices, 500u);
  EXPECT_EQ(header->texture_width, 80u);
  EXPECT_EQ(header->texture_height, 60u);
  EXPECT_EQ(header->volume.size_m, 2);
  EXPECT_EQ(80 + header->geometry_bytes + header->texture_bytes, bytes->size());
}

TEST(FrameCodec, SameFrameSameBytes) {
  EXPECT_EQ(*encode_frame(test::frame(30, 30), {}), *encode_frame(test::frame(30, 30), {}));
}

TEST(FrameCodec, TextureComesBackAsItWas) {
  Frame3D frame;
  frame.texture = test::picture(101, 57);
  EncodeOptions options;
  options.texture_quality = 95;
  const Frame3D back = decoded(frame, options);
  ASSERT_EQ(back.texture.width(), 101);
  ASSERT_EQ(back.texture.height(), 57);
  double sum = 0;
  for (std::size_t i = 0; i < frame.texture.size(); ++i)
    sum += std::pow(double{static_cast<double>(frame.texture.data()[i])} - back.texture.data()[i], 2);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(frame.texture.size())), 4);
}

TEST(FrameCodec, GreyTextureComesBackAsRgb) {
  Frame3D frame;
  frame.texture = test::picture(32, 32, 1);
  const Frame3D back = decoded(frame, {});
  ASSERT_EQ(back.texture.channels(), 3);
  EXPECT_NEAR(back.texture.row(9)[9 * 3 + 1], frame.texture.row(9)[9], 8);
}

TEST(FrameCodec, EmptyFrameIsAFrame) {
  Frame3D frame;
  frame.number = 5;
  const Frame3D back = decoded(frame, {});
  EXPECT_EQ(back.number, 5u);
  EXPECT_TRUE(back.surface.positions.empty());
  EXPECT_TRUE(back.texture.empty());
}

TEST(FrameCodec, PointsWithoutTrianglesKeepTheirOrder) {
  Frame3D frame = test::frame(20, 20);
  frame.surface.triangles.clear();
  const Frame3D back = decoded(frame, {});
  ASSERT_EQ(back.surface.positions.size(), 400u);
  for (std::size_t i = 0; i < 400; ++i)
    ASSERT_LT(distance(back.surface.positions[i], frame.surface.positions[i]), 0.0003);
}

TEST(FrameCodec, ManyEqualPointsAreNotRefusedAsTooSmall) {
  Frame3D frame;
  frame.surface.positions.assign(50'000, Vec3f{0.1f, 0.2f, 1});
  EXPECT_EQ(decoded(frame, {}).surface.positions.size(), 50'000u);
}

TEST(FrameCodec, APlaneIsNotRefusedAsTooSmall) {
  Frame3D frame;
  frame.surface = test::wavy_grid(200, 200, 0, false);
  for (std::size_t i = 0; i < frame.surface.positions.size(); ++i)
    frame.surface.positions[i] = {static_cast<float>(i % 200) / 256, static_cast<float>(i / 200) / 256, 1};
  frame.surface.texture_coordinates.clear();
  for (const int speed : {0, 5, 9}) {
    EncodeOptions options;
    options.draco_speed = speed;
    EXPECT_EQ(decoded(frame, options).surface.triangles.size(), frame.surface.triangles.size());
  }
}

TEST(FrameCodec, DegenerateTrianglesAndLooseVerticesAreLeftOut) {
  Frame3D frame;
  frame.surface.positions = {{0, 0, 1}, {0.1f, 0, 1}, {0, 0.1f, 1}, {0.1f, 0.1f, 1}};
  frame.surface.triangles = {{0, 1, 2}, {1, 1, 3}, {2, 3, 2}};
  const Frame3D back = decoded(frame, {});
  EXPECT_EQ(back.surface.triangles.size(), 1u);
  EXPECT_EQ(back.surface.positions.size(), 3u);
}

TEST(FrameCodec, OnlyDegenerateTrianglesLeaveAnEmptySurface) {
  Frame3D frame;
  frame.surface.positions = {{0, 0, 1}, {0.1f, 0, 1}};
  frame.surface.triangles = {{0, 1, 1}};
  EXPECT_TRUE(decoded(frame, {}).surface.positions.empty());
}

TEST(FrameCodec, WhatLiesOutsideTheVolumeIsLeftOut) {
  Frame3D frame;
  frame.surface.positions = {{0, 0, 1}, {0.1f, 0, 1}, {0, 0.1f, 1}, {0.1f, 0.1f, 3}};
  frame.surface.triangles = {{0, 1, 2}, {1, 2, 3}};
  EncodeOptions options;
  options.volume = kVolume;
  const Frame3D back = decoded(frame, options);
  EXPECT_EQ(back.surface.triangles.size(), 1u);
  EXPECT_EQ(back.surface.positions.size(), 3u);
}

TEST(FrameCodec, NonManifoldSurfacesSurvive) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    test::Random random(seed);
    Frame3D frame;
    const std::uint32_t vertices = 4 + random.below(30);
    for (std::uint32_t i = 0; i < vertices; ++i)
      frame.surface.positions.push_back({random.unit(), random.unit(), 1 + random.unit()});
    const std::uint32_t triangles = 1 + random.below(120);
    std::size_t whole = 0;
    for (std::uint32_t i = 0; i < triangles; ++i) {
      const Triangle t{random.below(vertices), random.below(vertices), random.below(vertices)};
      frame.surface.triangles.push_back(t);
      whole += t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    }
    EncodeOptions options;
    options.draco_speed = static_cast<int>(seed % 10);
    EXPECT_EQ(decoded(frame, options).surface.triangles.size(), whole) << "seed " << seed;
  }
}

TEST(FrameCodec, RefusesBadInputInWords) {
  const auto message = [](const Frame3D& frame, const EncodeOptions& options = {}) {
    const auto bytes = encode_frame(frame, options);
    return bytes ? std::string("no error") : bytes.error().message;
  };
  Frame3D frame;
  frame.surface.positions = {{0, 0, std::numeric_limits<float>::quiet_NaN()}};
  EXPECT_NE(message(frame).find("not finite"), std::string::npos);
  frame.surface.positions = {{0, 0, 1}, {0, 1, 1}};
  frame.surface.triangles = {{0, 1, 2}};
  EXPECT_NE(message(frame).find("vertex 2 of 2"), std::string::npos);
  frame.surface.triangles.clear();
  frame.surface.normals = {{0, 0, 1}};
  EXPECT_NE(message(frame).find("1 normals"), std::string::npos);
  frame.surface.normals.clear();
  frame.texture = Image8(4, 4, 2);
  EXPECT_NE(message(frame).find("2 channels"), std::string::npos);
}

TEST(FrameCodec, RefusesOptionsOutOfRange) {
  const auto refuses = [](auto change) {
    EncodeOptions options;
    change(options);
    return !encode_frame(test::frame(4, 4), options).ok();
  };
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.position_bits = 7; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.position_bits = 21; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.texture_coordinate_bits = 17; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.normal_bits = 1; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.draco_speed = 10; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.draco_speed = -1; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.texture_quality = 0; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.volume.size_m = -1; }));
  EXPECT_TRUE(refuses([](EncodeOptions& o) { o.geometry = static_cast<GeometryCodec>(9); }));
}

}  // namespace
}  // namespace relievo
