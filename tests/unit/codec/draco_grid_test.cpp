// SPDX-License-Identifier: Apache-2.0
// Geometry codec 3: what is sent comes back exactly as codec 2 brings it back; a decoder of Draco's own opens
// what is sent; whatever bytes come, nothing worse than an error happens.
#include <draco/compression/decode.h>
#include <draco/point_cloud/point_cloud.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "codec/draco_grid.h"
#include "codec/draco_numbers.h"
#include "codec/frame3d_codec.h"
#include "codec/grid_points.h"
#include "codec/grid_symbols.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

EncodeOptions options_of(GeometryCodec geometry, int step_bits = 4) {
  return {.geometry = geometry, .texture = TextureCodec::kNone, .step_bits = step_bits};
}

Bytes encoded(const test::GridScene& scene, const Frame3D& frame, const EncodeOptions& options) {
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  auto bytes = encoder.encode(frame, options);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message;
  return *bytes;
}

void expect_equal(const Surface& a, const Surface& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.texture_coordinates, b.texture_coordinates);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.sigmas_m, b.sigmas_m);
  EXPECT_EQ(a.interpolated, b.interpolated);
  ASSERT_EQ(a.grid.size(), b.grid.size());
  for (std::size_t i = 0; i < a.grid.size(); ++i) {
    EXPECT_EQ(a.grid[i].boundary, b.grid[i].boundary);
    EXPECT_EQ(a.grid[i].line, b.grid[i].line);
    EXPECT_EQ(a.grid[i].column_px, b.grid[i].column_px);
  }
}

struct Case {
  const char* name;
  test::GridScene scene;
  int step_bits = 4;
};

class DracoGridRoundTrip : public testing::TestWithParam<Case> {};

TEST_P(DracoGridRoundTrip, GivesWhatTheGridGives) {
  const Case& c = GetParam();
  const Frame3D frame = test::grid_frame(c.scene);
  const Bytes bytes = encoded(c.scene, frame, options_of(GeometryCodec::kDracoGrid, c.step_bits));
  const auto header = read_frame_header(bytes);
  ASSERT_TRUE(header) << header.error().message;
  EXPECT_EQ(header->geometry, GeometryCodec::kDracoGrid);
  EXPECT_TRUE(header->is_key);
  EXPECT_EQ(header->vertices, frame.surface.positions.size());
  EXPECT_EQ(header->triangles, frame.surface.triangles.size());
  const auto back = decode_frame(bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->number, frame.number);
  const auto grid = decode_frame(encoded(c.scene, frame, options_of(GeometryCodec::kGrid, c.step_bits)));
  ASSERT_TRUE(grid) << grid.error().message;
  expect_equal(back->surface, grid->surface);
  EXPECT_EQ(encoded(c.scene, frame, options_of(GeometryCodec::kDracoGrid, c.step_bits)), bytes)
      << "the same frame gives the same bytes";
}

INSTANTIATE_TEST_SUITE_P(Scenes, DracoGridRoundTrip,
                         testing::Values(Case{"plain", {}}, Case{"noisy", {.noise_px = 1}},
                                         Case{"lenses", {.distorts = true}}, Case{"fine", {}, 8},
                                         Case{"coarse", {}, 0}, Case{"quality", {.quality = true}},
                                         Case{"wide", {.width = 1280, .height = 320, .stripes = 131}, 5},
                                         Case{"wild", {.noise_px = 30}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(DracoGrid, CellsHoldAnyOfTheirTriangles) {
  const test::GridScene scene{.stripes = 17, .noise_px = 0};
  Frame3D frame = test::grid_frame(scene);
  test::Random random(5);
  std::vector<Triangle> some;
  for (const Triangle& t : frame.surface.triangles)
    if (random.below(3) != 0) some.push_back(t);
  frame.surface.triangles = some;
  const auto back = decode_frame(encoded(scene, frame, options_of(GeometryCodec::kDracoGrid)));
  ASSERT_TRUE(back) << back.error().message;
  const auto grid = decode_frame(encoded(scene, frame, options_of(GeometryCodec::kGrid)));
  ASSERT_TRUE(grid);
  expect_equal(back->surface, grid->surface);
}

TEST(DracoGrid, OneVertexIsAFrame) {
  const test::GridScene scene;
  Frame3D frame = test::grid_frame(scene);
  const GridPoint kept = frame.surface.grid[99];
  test::drop_vertices(frame,
                      [&](const GridPoint& p) { return p.line != kept.line || p.boundary != kept.boundary; });
  const auto back = decode_frame(encoded(scene, frame, options_of(GeometryCodec::kDracoGrid)));
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->surface.grid.size(), 1U);
  EXPECT_EQ(back->surface.grid[0].line, kept.line);
  EXPECT_EQ(back->surface.grid[0].boundary, kept.boundary);
}

TEST(DracoGrid, AllAlikeIsNotSmallerThanTheFormatAllows) {
  // Columns that follow from one another exactly: Draco needs next to nothing for them.
  const test::GridScene scene{.width = 1280, .height = 1024, .stripes = 301};
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  StripeGrid grid;
  grid.reset(calibration.boundaries(), calibration.lines(), 4);
  for (int line = 0; line < grid.lines; ++line)
    for (int b = 0; b < grid.boundaries; ++b) grid.columns[grid.at(line, b)] = 16 * 100 + 30 * b;
  const auto coded = encode_draco_grid(grid, calibration, {}, 1);
  ASSERT_TRUE(coded) << coded.error().message;
  EXPECT_EQ(grid.vertices, 300U * 512U);
  EXPECT_GE(coded->size(), grid.vertices / 256);
  StripeGrid back;
  const auto head = decode_draco_grid(*coded, grid.vertices, grid.triangles, back);
  ASSERT_TRUE(head) << head.error().message;
  EXPECT_EQ(back.columns, grid.columns);
}

TEST(DracoGrid, ToleranceMovesColumnsNoFurther) {
  const test::GridScene scene{.noise_px = 0.2F};
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  StripeGrid grid;
  ASSERT_TRUE(to_grid(test::grid_frame(scene).surface, calibration, {}, grid).ok());
  const StripeGrid sent = grid;
  const auto exact = encode_draco_grid(grid, calibration, {}, 1);
  const std::vector<std::uint8_t> tolerance(grid.columns.size(), 2);
  const auto coded = encode_draco_grid(grid, calibration, tolerance, 1);
  ASSERT_TRUE(exact && coded);
  EXPECT_LT(coded->size(), exact->size());
  StripeGrid back;
  ASSERT_TRUE(decode_draco_grid(*coded, grid.vertices, grid.triangles, back).ok());
  EXPECT_EQ(back.columns, grid.columns) << "the encoder knows what is found";
  int moved = 0;
  for (std::size_t i = 0; i < back.columns.size(); ++i) {
    ASSERT_LE(std::abs(back.columns[i] - sent.columns[i]), 2);
    moved += back.columns[i] != sent.columns[i];
  }
  EXPECT_GT(moved, 100);
}

TEST(DracoGrid, DeltaGridsKeepTheirKeyFrameThroughIt) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  EncodeOptions options = options_of(GeometryCodec::kGrid);
  options.key_interval = 100;
  const Frame3D frame = test::grid_frame(scene);
  const auto key = encoder.encode(frame, options);
  const auto delta = encoder.encode(frame, options);
  options.geometry = GeometryCodec::kDracoGrid;
  const auto between = encoder.encode(frame, options);
  options.geometry = GeometryCodec::kGrid;
  const auto next = encoder.encode(frame, options);
  ASSERT_TRUE(key && delta && between && next);
  EXPECT_FALSE(is_key_frame(*delta));
  EXPECT_TRUE(is_key_frame(*between));
  EXPECT_TRUE(is_key_frame(*next)) << "nothing is left to build on";
  FrameDecoder decoder;
  for (const Bytes& bytes : {*key, *between, *delta, *next}) {
    const auto back = decoder.decode(bytes);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->surface.positions.size(), frame.surface.positions.size());
  }
  // One of another rig takes the key frame's calibration away.
  const test::GridScene other{.distorts = true};
  ASSERT_TRUE(
      decoder.decode(encoded(other, test::grid_frame(other), options_of(GeometryCodec::kDracoGrid))).ok());
  EXPECT_FALSE(decoder.can_decode(*delta));
  EXPECT_FALSE(decoder.decode(*delta).ok());
}

/// The geometry section of a frame, and what it holds.
struct Section {
  Bytes bytes;
  std::uint32_t vertices = 0, triangles = 0;
};

Section section_of(const test::GridScene& scene) {
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  StripeGrid grid;
  EXPECT_TRUE(to_grid(test::grid_frame(scene).surface, calibration, {.with_quality = true}, grid).ok());
  auto coded = encode_draco_grid(grid, calibration, {}, 1);
  EXPECT_TRUE(coded.ok());
  return {*std::move(coded), grid.vertices, grid.triangles};
}

const test::GridScene kScene{.width = 320, .height = 144, .stripes = 27, .distorts = true, .quality = true};

TEST(DracoGrid, AnyDecoderOfDracoOpensTheSection) {
  const Section section = section_of(kScene);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(section.bytes.data()), section.bytes.size());
  const auto cloud = draco::Decoder().DecodePointCloudFromBuffer(&buffer);
  ASSERT_TRUE(cloud.ok()) << cloud.status().error_msg_string();
  const draco::PointCloud& vertices = *cloud.value();
  EXPECT_EQ(vertices.num_points(), section.vertices);
  ASSERT_EQ(vertices.num_attributes(), 3);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(vertices.attribute(i)->attribute_type(), draco::GeometryAttribute::GENERIC);
    EXPECT_EQ(vertices.attribute(i)->num_components(), 1);
    EXPECT_EQ(vertices.attribute(i)->data_type(), draco::DT_INT32);
  }
  // The other cloud follows.
  draco::DecoderBuffer rest;
  rest.Init(buffer.data_head(), static_cast<std::size_t>(buffer.remaining_size()));
  const auto places = draco::Decoder().DecodePointCloudFromBuffer(&rest);
  ASSERT_TRUE(places.ok()) << places.status().error_msg_string();
  EXPECT_EQ(places.value()->num_attributes(), 2);
}

TEST(HostileDracoGrid, EveryTruncationIsRefused) {
  const Section section = section_of(kScene);
  StripeGrid grid;
  ASSERT_TRUE(decode_draco_grid(section.bytes, section.vertices, section.triangles, grid).ok());
  for (std::size_t size = 0; size < section.bytes.size(); ++size)
    ASSERT_FALSE(
        decode_draco_grid(std::span(section.bytes).first(size), section.vertices, section.triangles, grid)
            .ok())
        << size;
}

TEST(HostileDracoGrid, OtherCountsAreRefused) {
  const Section section = section_of(kScene);
  StripeGrid grid;
  EXPECT_FALSE(decode_draco_grid(section.bytes, section.vertices + 1, section.triangles, grid).ok());
  EXPECT_FALSE(decode_draco_grid(section.bytes, section.vertices, section.triangles - 1, grid).ok());
}

TEST(HostileDracoGrid, BytesBetweenThePartsAreRefused) {
  Section section = section_of(kScene);
  std::uint16_t tail_bytes = 0;
  std::memcpy(&tail_bytes, section.bytes.data() + section.bytes.size() - 2, 2);
  const auto tail = section.bytes.end() - tail_bytes;
  StripeGrid grid;
  const auto at = section.bytes.insert(tail, 0);
  EXPECT_TRUE(decode_draco_grid(section.bytes, section.vertices, section.triangles, grid).ok());
  *at = 1;
  EXPECT_FALSE(decode_draco_grid(section.bytes, section.vertices, section.triangles, grid).ok());
}

TEST(HostileDracoGrid, ListsOfOtherLengthsAndKindsAreRefused) {
  const std::vector<std::int32_t> some{1, -2, 3, 0, 0, 4};
  const std::vector<std::vector<std::int32_t>> two{some, some};
  const auto bytes = encode_numbers(two);
  ASSERT_TRUE(bytes);
  std::vector<std::vector<std::int32_t>> back(2);
  ASSERT_TRUE(decode_numbers(*bytes, 6, back).ok());
  EXPECT_EQ(back, two);
  EXPECT_FALSE(decode_numbers(*bytes, 5, back).ok());
  std::vector<std::vector<std::int32_t>> one(1), three(3);
  EXPECT_FALSE(decode_numbers(*bytes, 6, one).ok());
  EXPECT_FALSE(decode_numbers(*bytes, 6, three).ok());
  Bytes longer = *bytes;
  longer.push_back(0);
  EXPECT_FALSE(decode_numbers(longer, 6, back).ok());
}

TEST(HostileDracoGrid, MutatedBytesGiveAnErrorOrAGrid) {
  const Section section = section_of(kScene);
  test::Random random(11);
  int refused = 0, decoded = 0;
  for (int i = 0; i < 3000; ++i) {
    Bytes bytes = section.bytes;
    const auto size = static_cast<std::uint32_t>(bytes.size());
    for (std::uint32_t k = 1 + random.below(4); k > 0; --k) {
      const std::uint32_t at = random.below(3) == 0 ? size - 1 - random.below(180) : random.below(size);
      bytes[at] = static_cast<std::uint8_t>(random.below(2) == 0 ? bytes[at] ^ 1U << random.below(8)
                                                                 : random.below(256));
    }
    StripeGrid grid;
    const auto head = decode_draco_grid(bytes, section.vertices, section.triangles, grid);
    ++(head ? decoded : refused);
    Surface surface;
    if (!head || !GridPoints(head->calibration).to_surface(grid, surface)) continue;
    ASSERT_EQ(surface.positions.size(), section.vertices);
    ASSERT_EQ(surface.triangles.size(), section.triangles);
    for (const Vec3f& p : surface.positions)
      for (const float x : p) ASSERT_TRUE(std::isfinite(x));
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(decoded, 50);  // a changed weight, say
}

}  // namespace
}  // namespace relievo
