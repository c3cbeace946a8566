// SPDX-License-Identifier: Apache-2.0
// Proves: a frame of half the lines is a frame like any other, and its surface is the full one's.
#include "codec/reduce.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "codec/frame3d_codec.h"
#include "codec/stripe_grid.h"
#include "tests/support/make_grid.h"

namespace relievo::test {
namespace {

constexpr int kLines = 241;  // of the pictures, at most

using Place = std::pair<int, int>;  // line and boundary

std::map<Place, std::uint32_t> places(const Surface& surface, int line_stride = 1) {
  std::map<Place, std::uint32_t> out;
  for (std::uint32_t v = 0; v < surface.grid.size(); ++v)
    out[{surface.grid[v].line * line_stride, surface.grid[v].boundary}] = v;
  return out;
}

TEST(HalveLines, KeepsTheVerticesOfEverySecondLine) {
  const Frame3D frame = grid_frame({.quality = true});
  Surface half;
  ASSERT_TRUE(halve_lines(frame.surface, kLines, half));
  const auto all = places(frame.surface);
  std::size_t even = 0;
  for (const auto& [place, v] : all) even += place.first % 2 == 0;
  EXPECT_EQ(half.positions.size(), even);
  EXPECT_EQ(half.sigmas_m.size(), even);
  for (const auto& [place, v] : places(half, 2)) {
    const std::uint32_t before = all.at(place);
    EXPECT_EQ(half.positions[v], frame.surface.positions[before]);
    EXPECT_EQ(half.texture_coordinates[v], frame.surface.texture_coordinates[before]);
    EXPECT_EQ(half.grid[v].column_px, frame.surface.grid[before].column_px);
  }
  EXPECT_GT(half.triangles.size(), frame.surface.triangles.size() * 2 / 5);
}

TEST(HalveLines, BridgesNoHoleAndNoStep) {
  const Frame3D frame = grid_frame({});
  Surface half;
  ASSERT_TRUE(halve_lines(frame.surface, kLines, half));
  // Which places the full surface joins by an edge along a line or from line to line.
  const auto joined = [](const Surface& s) {
    std::set<std::pair<Place, Place>> edges;
    for (const Triangle& t : s.triangles)
      for (const std::uint32_t a : t)
        for (const std::uint32_t b : t) {
          const GridPoint& p = s.grid[a];
          const GridPoint& q = s.grid[b];
          edges.insert({{p.line, p.boundary}, {q.line, q.boundary}});
        }
    return edges;
  };
  const auto before = joined(frame.surface);
  for (const auto& [from, to] : joined(half)) {
    if (from.second != to.second || from.first >= to.first) continue;  // edges down
    const Place top{2 * from.first, from.second}, middle{2 * from.first + 1, from.second},
        bottom{2 * to.first, to.second};
    EXPECT_TRUE(before.contains({top, middle}) && before.contains({middle, bottom}))
        << "line " << top.first << ", boundary " << top.second;
  }
}

TEST(HalveLines, TravelsAsAGridAndDecodesToTheSameSurface) {
  const GridScene scene{.distorts = true, .quality = true};
  Frame3D frame = grid_frame(scene);
  Frame3D half;
  ASSERT_TRUE(halve_lines(frame.surface, kLines, half.surface));
  const EncodeOptions options{.geometry = GeometryCodec::kGrid, .step_bits = 6};
  FrameEncoder encoder(grid_rig(scene), grid_pattern(scene), 2);
  const auto bytes = encoder.encode(half, options);
  ASSERT_TRUE(bytes.ok()) << bytes.error().message;
  FrameEncoder full_encoder(grid_rig(scene), grid_pattern(scene));
  const auto full = full_encoder.encode(frame, options);
  ASSERT_TRUE(full.ok());
  EXPECT_EQ(read_frame_header(*bytes)->geometry, GeometryCodec::kGrid);
  EXPECT_LT(bytes->size(), full->size() * 2 / 3);
  const auto decoded = decode_frame(*bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  EXPECT_EQ(decoded->surface.triangles.size(), half.surface.triangles.size());
  const auto sent = places(half.surface);
  ASSERT_EQ(decoded->surface.positions.size(), sent.size());
  for (std::uint32_t v = 0; v < decoded->surface.grid.size(); ++v) {
    const GridPoint& p = decoded->surface.grid[v];
    const Vec3f& truth = half.surface.positions[sent.at({p.line, p.boundary})];
    const Vec3f& got = decoded->surface.positions[v];
    EXPECT_LT(std::hypot(got[0] - truth[0], got[1] - truth[1], got[2] - truth[2]), 1e-3F * truth[2]);
  }
}

TEST(HalveLines, IsNotForSurfacesOffTheGrid) {
  Frame3D frame = grid_frame({});
  Surface out;
  Surface without_places = frame.surface;
  without_places.grid.clear();
  EXPECT_FALSE(halve_lines(without_places, kLines, out));
  Surface twice = frame.surface;
  twice.grid[1] = twice.grid[0];
  EXPECT_FALSE(halve_lines(twice, kLines, out));
  Surface across = frame.surface;
  across.triangles.push_back({0, 1, static_cast<std::uint32_t>(across.positions.size() - 1)});
  EXPECT_FALSE(halve_lines(across, kLines, out));
  Surface foreign = frame.surface;
  foreign.triangles.push_back({0, 1, static_cast<std::uint32_t>(foreign.positions.size())});
  EXPECT_FALSE(halve_lines(foreign, kLines, out));
  EXPECT_TRUE(halve_lines(Surface(), kLines, out));
  EXPECT_TRUE(out.positions.empty());
}

TEST(Halve, IsTheMeanOfFourAndLeavesOddSides) {
  Image8 picture(4, 2, 1);
  const std::uint8_t values[] = {0, 2, 255, 255, 4, 6, 255, 254};
  std::copy(std::begin(values), std::end(values), picture.data());
  Image8 half;
  halve(picture, half);
  ASSERT_EQ(half.width(), 2);
  ASSERT_EQ(half.height(), 1);
  EXPECT_EQ(half.data()[0], 3);
  EXPECT_EQ(half.data()[1], 255);
  halve(Image8(5, 6, 3), half);
  EXPECT_EQ(half.width(), 5);
  EXPECT_EQ(half.height(), 3);
}

TEST(Halve, AnyPictureIsTheMeanOfItsPixels) {
  Random random(7);
  Image8 half;
  for (const auto& [width, height, channels] :
       {std::tuple(64, 20, 3), {66, 7, 3}, {37, 8, 3}, {64, 10, 1}, {31, 12, 1}, {2, 2, 3}}) {
    Image8 picture(width, height, channels);
    for (std::size_t i = 0; i < picture.size(); ++i)
      picture.data()[i] = static_cast<std::uint8_t>(random.below(256));
    halve(picture, half);
    const int across = 2 - width % 2, down = 2 - height % 2;
    ASSERT_EQ(half.width(), width / across);
    ASSERT_EQ(half.height(), height / down);
    for (int y = 0; y < half.height(); ++y)
      for (int i = 0; i < half.width() * channels; ++i) {
        int sum = across * down / 2;
        for (int dy = 0; dy < down; ++dy)
          for (int dx = 0; dx < across; ++dx)
            sum += picture.row(y * down + dy)[(i / channels * across + dx) * channels + i % channels];
        ASSERT_EQ(half.row(y)[i], sum / (across * down)) << width << " " << height << " " << y << " " << i;
      }
  }
}

TEST(HalveLines, OfAGridIsAsOfItsSurface) {
  for (const int height : {480, 482}) {
    const GridScene scene{.height = height, .quality = true};
    const Frame3D frame = grid_frame(scene);
    GridCalibration whole = grid_calibration(grid_rig(scene), grid_pattern(scene)), every_second = whole;
    whole.line_step_px = 2;
    every_second.line_step_px = 4;
    Surface half;
    ASSERT_TRUE(halve_lines(frame.surface, kLines, half));
    StripeGrid expected, grid;
    ASSERT_TRUE(to_grid(half, every_second, {.step_bits = 6, .with_quality = true}, expected));
    ASSERT_TRUE(to_grid(frame.surface, whole, {.step_bits = 6, .with_quality = true}, grid));
    std::vector<std::uint8_t> plane(grid.columns.size()), none;
    for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = static_cast<std::uint8_t>(grid.columns[i]);
    halve_lines(grid, std::array{&plane, &none});
    EXPECT_EQ(grid.lines, expected.lines);
    EXPECT_EQ(grid.columns, expected.columns);
    EXPECT_EQ(grid.sigmas, expected.sigmas);
    EXPECT_EQ(grid.interpolated, expected.interpolated);
    EXPECT_EQ(grid.vertices, expected.vertices);
    EXPECT_EQ(grid.triangles, expected.triangles);
    ASSERT_EQ(grid.cells.size(), expected.cells.size());
    for (std::size_t i = 0; i < grid.cells.size(); ++i) {
      const auto both = [](std::uint8_t cell) {
        return cell == grid_cell::kTurned ? grid_cell::kStraight : cell;
      };
      ASSERT_EQ(both(grid.cells[i]), both(expected.cells[i])) << i;
    }
    ASSERT_EQ(plane.size(), grid.columns.size());
    for (int line = 0; line < grid.lines; ++line)
      for (int b = 0; b < grid.boundaries; ++b)
        ASSERT_EQ(plane[grid.at(line, b)], static_cast<std::uint8_t>(grid.columns[grid.at(line, b)]));
    EXPECT_TRUE(none.empty());
  }
}

}  // namespace
}  // namespace relievo::test
