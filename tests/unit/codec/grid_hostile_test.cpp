// SPDX-License-Identifier: Apache-2.0
// Grids that no encoder wrote: cut, mutated with a fixed seed, and with sizes that lie.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "codec/frame3d_codec.h"
#include "codec/grid_coder.h"
#include "codec/grid_points.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

struct Coded {
  Bytes bytes;
  std::uint32_t vertices = 0, triangles = 0;
};

struct Sent {
  Coded key, delta;
};

/// The geometry sections of two frames.
Sent sent(const test::GridScene& scene) {
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  GridEncoder encoder;
  Sent out;
  GridKey key;
  EXPECT_TRUE(to_grid(test::grid_frame(scene).surface, calibration, {.with_quality = true}, key.grid).ok());
  out.key.bytes = encoder.encode(key.grid, calibration, nullptr, {}, 1, {.slice_lines = 24});
  out.key.vertices = key.grid.vertices;
  out.key.triangles = key.grid.triangles;
  key.id = grid_id(out.key.bytes);
  StripeGrid next;
  test::GridScene moved = scene;
  moved.shift_px = 1;
  EXPECT_TRUE(to_grid(test::grid_frame(moved).surface, calibration, {.with_quality = true}, next).ok());
  out.delta.bytes = encoder.encode(next, calibration, &key, {}, 1, {.slice_lines = 24});
  out.delta.vertices = next.vertices;
  out.delta.triangles = next.triangles;
  return out;
}

/// What is decoded can be used, whatever it is.
void expect_sound(const GridHead& head, const StripeGrid& grid, const GridCalibration& calibration) {
  Surface surface;
  if (!GridPoints(head.is_key ? head.calibration : calibration).to_surface(grid, surface)) return;
  ASSERT_EQ(surface.positions.size(), grid.vertices);
  ASSERT_EQ(surface.triangles.size(), grid.triangles);
  for (const Vec3f& p : surface.positions)
    for (const float x : p) ASSERT_TRUE(std::isfinite(x));
  for (const Triangle& t : surface.triangles)
    for (const std::uint32_t v : t) ASSERT_LT(v, grid.vertices);
}

const test::GridScene kScene{.width = 320, .height = 144, .stripes = 27, .distorts = true, .quality = true};

TEST(HostileGrid, EveryTruncationIsRefused) {
  const Sent frames = sent(kScene);
  GridDecoder decoder;
  StripeGrid grid;
  ASSERT_TRUE(
      decoder.decode(frames.key.bytes, frames.key.vertices, frames.key.triangles, nullptr, grid).ok());
  for (std::size_t size = 0; size < frames.key.bytes.size(); ++size)
    ASSERT_FALSE(decoder
                     .decode(std::span(frames.key.bytes).first(size), frames.key.vertices,
                             frames.key.triangles, nullptr, grid)
                     .ok())
        << size;
}

TEST(HostileGrid, MutatedBytesGiveAnErrorOrAGrid) {
  const Sent frames = sent(kScene);
  const auto calibration = grid_calibration(test::grid_rig(kScene), test::grid_pattern(kScene));
  GridDecoder decoder;
  GridKey key;
  ASSERT_TRUE(
      decoder.decode(frames.key.bytes, frames.key.vertices, frames.key.triangles, nullptr, key.grid).ok());
  key.id = grid_id(frames.key.bytes);
  test::Random random(11);
  int refused = 0, decoded = 0;
  for (int i = 0; i < 4000; ++i) {
    const Coded& from = i % 2 == 0 ? frames.key : frames.delta;
    Bytes bytes = from.bytes;
    const std::uint32_t changes = 1 + random.below(4);
    for (std::uint32_t k = 0; k < changes; ++k) {
      const std::uint32_t at =
          random.below(3) == 0 ? random.below(200) : random.below(static_cast<std::uint32_t>(bytes.size()));
      bytes[at] = static_cast<std::uint8_t>(random.below(2) == 0 ? bytes[at] ^ 1U << random.below(8)
                                                                 : random.below(256));
    }
    StripeGrid grid;
    const auto head = decoder.decode(bytes, from.vertices, from.triangles, &key, grid);
    ++(head ? decoded : refused);
    if (head) expect_sound(*head, grid, calibration);
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(decoded, 50);  // a changed weight, say
  StripeGrid grid;
  EXPECT_TRUE(
      decoder.decode(frames.delta.bytes, frames.delta.vertices, frames.delta.triangles, &key, grid).ok());
}

TEST(HostileGrid, SizesThatNoBytesCanFillAreRefusedFirst) {
  const Sent frames = sent(kScene);
  Bytes bytes = frames.key.bytes;
  const std::uint16_t most = 16384;
  std::memcpy(bytes.data() + 2, &most, 2);
  std::memcpy(bytes.data() + 4, &most, 2);
  StripeGrid grid;
  EXPECT_FALSE(GridDecoder().decode(bytes, frames.key.vertices, frames.key.triangles, nullptr, grid).ok());
  EXPECT_TRUE(grid.columns.empty());
  // As a frame: more vertices than its bytes may stand for.
  FrameEncoder encoder(test::grid_rig(kScene), test::grid_pattern(kScene));
  EncodeOptions options;
  options.geometry = GeometryCodec::kGrid;
  Bytes frame = *encoder.encode(test::grid_frame(kScene), options);
  const std::uint32_t many = 3'900'000;
  std::memcpy(frame.data() + 40, &many, 4);
  EXPECT_FALSE(read_frame_header(frame).ok());
}

TEST(HostileGrid, LimitsOfTheReaderAreKept) {
  FrameEncoder encoder(test::grid_rig(kScene), test::grid_pattern(kScene));
  EncodeOptions options;
  options.geometry = GeometryCodec::kGrid;
  const Bytes frame = *encoder.encode(test::grid_frame(kScene), options);
  EXPECT_NE(decode_frame(frame, {.vertices = 100}).error().message.find("limit of 100"), std::string::npos);
  EXPECT_NE(decode_frame(frame, {.triangles = 100}).error().message.find("limit of 100"), std::string::npos);
}

}  // namespace
}  // namespace relievo
