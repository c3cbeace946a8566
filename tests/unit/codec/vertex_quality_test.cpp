// SPDX-License-Identifier: Apache-2.0
// Sigma and interpolation of each vertex: through a whole frame, in whatever order the vertices come back.
#include "codec/vertex_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>

#include "codec/frame3d_codec.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

/// What make() says of the vertex at these texture coordinates.
float sigma_at(const Vec2f& uv) {
  return uv[0] < 0.1F ? 0 : 1e-5F * std::exp2(6 * uv[0] + uv[1]);
}
bool interpolated_at(const Vec2f& uv) {
  return uv[0] + uv[1] > 1;
}

Frame3D make(int columns, int rows) {
  Frame3D frame = test::frame(columns, rows);
  for (const Vec2f& uv : frame.surface.texture_coordinates) {
    frame.surface.sigmas_m.push_back(sigma_at(uv));
    frame.surface.interpolated.push_back(interpolated_at(uv));
  }
  return frame;
}

Result<Frame3D> there_and_back(const Frame3D& frame, const EncodeOptions& options) {
  const auto bytes = encode_frame(frame, options);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message;
  return decode_frame(*bytes);
}

/// A code is at most an eighth of an octave off, and coordinates on the wire half a step of theirs.
void expect_told(const Surface& s) {
  ASSERT_EQ(s.sigmas_m.size(), s.positions.size());
  ASSERT_EQ(s.interpolated.size(), s.positions.size());
  for (std::size_t v = 0; v < s.positions.size(); ++v) {
    const Vec2f& uv = s.texture_coordinates[v];
    if (sigma_at(uv) == 0) {
      EXPECT_EQ(s.sigmas_m[v], 0);
    } else {
      ASSERT_NEAR(std::log2(s.sigmas_m[v] / sigma_at(uv)), 0, 0.125 + 7.0 / 512);
    }
    const bool tie = std::fabs(uv[0] + uv[1] - 1) < 2.0F / 256;
    EXPECT_TRUE(tie || (s.interpolated[v] != 0) == interpolated_at(uv));
  }
}

TEST(VertexQuality, ComesBackWithEveryVertex) {
  for (const int speed : {0, 4, 9}) {
    for (const int bits : {8, 12, 16}) {
      SCOPED_TRACE(speed * 100 + bits);
      EncodeOptions options;
      options.draco_speed = speed;
      options.texture_coordinate_bits = bits;
      const auto back = there_and_back(make(40, 50), options);
      ASSERT_TRUE(back.ok()) << back.error().message;
      expect_told(back->surface);
    }
  }
}

TEST(VertexQuality, OfPointsWithoutTriangles) {
  Frame3D frame = make(23, 31);
  frame.surface.triangles.clear();
  const auto back = there_and_back(frame, {});
  ASSERT_TRUE(back.ok()) << back.error().message;
  expect_told(back->surface);
}

TEST(VertexQuality, OfVerticesAtOnePlaceIsTheWorse) {
  Frame3D frame = make(12, 12);
  Surface& s = frame.surface;
  const auto twin = static_cast<std::uint32_t>(s.positions.size());
  s.positions.push_back({0, 0, 0.5F});
  s.texture_coordinates.push_back(s.texture_coordinates[30]);
  s.sigmas_m.push_back(0.01F);
  s.interpolated.push_back(1);
  s.triangles.push_back({twin, 0, 1});
  const auto back = there_and_back(frame, {});
  ASSERT_TRUE(back.ok()) << back.error().message;
  int there = 0;
  for (std::size_t v = 0; v < back->surface.positions.size(); ++v) {
    const Vec2f& uv = back->surface.texture_coordinates[v];
    if (std::hypot(uv[0] - s.texture_coordinates[30][0], uv[1] - s.texture_coordinates[30][1]) > 0.01)
      continue;
    ++there;
    EXPECT_NEAR(back->surface.sigmas_m[v], 0.01F, 0.001F);
    EXPECT_EQ(back->surface.interpolated[v], 1);
  }
  EXPECT_EQ(there, 2);
}

TEST(VertexQuality, IsNotSentWhereNothingIsSaidOrWanted) {
  const Frame3D frame = make(20, 20);
  const auto with = encode_frame(frame, {});
  const auto unwanted = encode_frame(frame, {.quality = false});
  const auto nothing = encode_frame(test::frame(20, 20), {});
  ASSERT_TRUE(with && unwanted && nothing);
  EXPECT_GT(read_frame_header(*with)->quality_bytes, 0U);
  EXPECT_EQ(*unwanted, *nothing);
  EXPECT_EQ(read_frame_header(*nothing)->quality_bytes, 0U);
  EXPECT_TRUE(decode_frame(*nothing)->surface.sigmas_m.empty());
}

TEST(VertexQuality, TakesFewBitsOfASmoothSurface) {
  const Frame3D frame = make(90, 240);
  const auto bytes = encode_frame(frame, {});
  ASSERT_TRUE(bytes);
  const FrameHeader header = *read_frame_header(*bytes);
  EXPECT_LT(8.0 * header.quality_bytes / header.vertices, 4);  // every line has three jumps
}

TEST(VertexQuality, DamageIsRefusedOrHarmless) {
  const Frame3D frame = make(15, 20);
  std::vector<std::uint32_t> sent;
  for (std::uint32_t v = 0; v < frame.surface.positions.size(); ++v) sent.push_back(v);
  const Bytes good = encode_vertex_quality(frame.surface, sent, 12);
  Surface surface = frame.surface.positions.empty() ? Surface{} : test::wavy_grid(15, 20);
  ASSERT_TRUE(decode_vertex_quality(good, surface));
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_FALSE(decode_vertex_quality(std::span(good).first(size), surface)) << size;
  Bytes longer = good;
  longer.push_back(0);
  EXPECT_FALSE(decode_vertex_quality(longer, surface));
  test::Random random(5);
  for (int i = 0; i < 3000; ++i) {
    Bytes bad = good;
    for (std::uint32_t n = 1 + random.below(4); n > 0; --n)
      bad[random.below(static_cast<std::uint32_t>(bad.size()))] = static_cast<std::uint8_t>(random.bits());
    if (!decode_vertex_quality(bad, surface)) continue;
    for (const float sigma : surface.sigmas_m) ASSERT_TRUE(sigma >= 0 && sigma < 0.1F);
  }
  Surface other = test::wavy_grid(16, 20);
  EXPECT_FALSE(decode_vertex_quality(good, other));
  EXPECT_TRUE(other.sigmas_m.empty());
}

TEST(VertexQuality, CodesAreWithinNinePerCentFromAMicrometreUp) {
  for (float sigma = 1e-6F; sigma < 0.045F; sigma *= 1.01F)
    ASSERT_NEAR(sigma_of_code(sigma_code(sigma)) / sigma, 1, 0.091);
  EXPECT_EQ(sigma_of_code(sigma_code(0)), 0);
  EXPECT_GT(sigma_of_code(sigma_code(1e-9F)), 0);
  EXPECT_GT(sigma_of_code(sigma_code(10)), 0.04F);
}

}  // namespace
}  // namespace relievo
