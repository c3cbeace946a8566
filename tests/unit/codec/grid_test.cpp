// SPDX-License-Identifier: Apache-2.0
// Geometry codec 2: what is sent comes back, to the step; delta frames build on their key frame and say so
// where it is missing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "base/parallel.h"
#include "codec/frame3d_codec.h"
#include "codec/grid_coder.h"
#include "codec/grid_points.h"
#include "codec/grid_predict.h"
#include "codec/rans.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

EncodeOptions grid_options(int step_bits = 4) {
  EncodeOptions options;
  options.geometry = GeometryCodec::kGrid;
  options.step_bits = step_bits;
  return options;
}

/// A set of triangles that does not mind where each begins.
std::multiset<std::array<std::uint32_t, 3>> cycles(const std::vector<Triangle>& triangles) {
  std::multiset<std::array<std::uint32_t, 3>> out;
  for (Triangle t : triangles) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    out.insert(t);
  }
  return out;
}

double area_m2(const Surface& s) {
  double area = 0;
  for (const Triangle& t : s.triangles) {
    std::array<double, 3> u{}, v{};
    for (std::size_t i = 0; i < 3; ++i) {
      u[i] = s.positions[t[1]][i] - s.positions[t[0]][i];
      v[i] = s.positions[t[2]][i] - s.positions[t[0]][i];
    }
    area += std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return area;
}

/// Every vertex at its place, its column within half a step, its position where the reconstruction's own
/// triangulation puts that column.
void expect_same(const test::GridScene& scene, const Surface& sent, const Surface& got, int step_bits) {
  ASSERT_EQ(got.positions.size(), sent.positions.size());
  ASSERT_EQ(got.triangles.size(), sent.triangles.size());
  const Triangulator triangulator(test::grid_rig(scene), test::grid_pattern(scene), scene.height / 2, 2);
  const float step = 1.F / static_cast<float>(1 << step_bits);
  for (std::size_t i = 0; i < sent.positions.size(); ++i) {
    const GridPoint& a = sent.grid[i];
    const GridPoint& b = got.grid[i];
    ASSERT_EQ(a.boundary, b.boundary) << i;
    ASSERT_EQ(a.line, b.line) << i;
    ASSERT_LE(std::fabs(a.column_px - b.column_px), step / 2 + 1e-4F) << i;
    const auto point = triangulator.point(b.boundary, b.line, b.column_px);
    ASSERT_TRUE(point);
    for (std::size_t k = 0; k < 3; ++k)
      ASSERT_NEAR((*point)[k], got.positions[i][k], 1e-5 * static_cast<double>((*point)[2])) << i;
    ASSERT_NEAR(got.texture_coordinates[i][0], (b.column_px + 0.5F) / static_cast<float>(scene.width), 1e-6);
    ASSERT_NEAR(got.texture_coordinates[i][1], sent.texture_coordinates[i][1], 1e-6);
  }
  if (step_bits >= 4) {
    EXPECT_NEAR(area_m2(got) / area_m2(sent), 1, 0.01);
  }
}

struct Case {
  const char* name;
  test::GridScene scene;
  int step_bits = 4;
  int slice_lines = 270;
};

class GridRoundTrip : public testing::TestWithParam<Case> {};

TEST_P(GridRoundTrip, KeepsVerticesAndTriangles) {
  const Case& c = GetParam();
  const Frame3D frame = test::grid_frame(c.scene);
  ASSERT_GT(frame.surface.positions.size(), 500U);
  FrameEncoder encoder(test::grid_rig(c.scene), test::grid_pattern(c.scene));
  EncodeOptions options = grid_options(c.step_bits);
  options.slice_lines = c.slice_lines;
  const auto bytes = encoder.encode(frame, options);
  ASSERT_TRUE(bytes) << bytes.error().message;
  const auto header = read_frame_header(*bytes);
  ASSERT_TRUE(header) << header.error().message;
  EXPECT_EQ(header->geometry, GeometryCodec::kGrid);
  EXPECT_TRUE(header->is_key);
  const auto back = decode_frame(*bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->number, frame.number);
  EXPECT_EQ(back->time_ns, frame.time_ns);
  expect_same(c.scene, frame.surface, back->surface, c.step_bits);
  EXPECT_EQ(*encoder.encode(frame, options), *bytes) << "the same frame gives the same bytes";
}

INSTANTIATE_TEST_SUITE_P(Scenes, GridRoundTrip,
                         testing::Values(Case{"plain", {}}, Case{"noisy", {.noise_px = 1}},
                                         Case{"lenses", {.distorts = true}}, Case{"fine", {}, 8},
                                         Case{"coarse", {}, 0}, Case{"slices", {}, 4, 16},
                                         Case{"one_line_over", {}, 4, 239},
                                         Case{"wide", {.width = 1280, .height = 320, .stripes = 131}, 5},
                                         Case{"wild", {.noise_px = 30}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Grid, TrianglesOfPartsOfCellsAreExact) {
  // Every cell by itself has all ways to hold triangles.
  const test::GridScene scene{.stripes = 17, .noise_px = 0};
  Frame3D frame = test::grid_frame(scene);
  test::Random random(5);
  std::vector<Triangle> some;
  for (const Triangle& t : frame.surface.triangles)
    if (random.below(3) != 0) some.push_back(t);
  frame.surface.triangles = some;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto bytes = encoder.encode(frame, grid_options());
  ASSERT_TRUE(bytes);
  const auto back = decode_frame(*bytes);
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->surface.triangles.size(), some.size());
  // Cells with one triangle keep it; those with both may turn their diagonal.
  std::map<std::pair<int, int>, int> cells;
  const auto cell_of = [&](const Triangle& t) {
    int line = 1 << 20, boundary = 1 << 20;
    for (const std::uint32_t v : t) {
      line = std::min<int>(line, frame.surface.grid[v].line);
      boundary = std::min<int>(boundary, frame.surface.grid[v].boundary);
    }
    return std::pair{line, boundary};
  };
  for (const Triangle& t : some) ++cells[cell_of(t)];
  std::vector<Triangle> single, single_back;
  for (const Triangle& t : some)
    if (cells[cell_of(t)] == 1) single.push_back(t);
  for (const Triangle& t : back->surface.triangles)
    if (cells[cell_of(t)] == 1) single_back.push_back(t);
  ASSERT_GT(single.size(), 100U);
  EXPECT_EQ(cycles(single), cycles(single_back));
}

/// A symbol of two that never comes, beside one that does: such a table is used all the same.
TEST(Grid, BlocksThatNeverAreAsThoseAroundThemDecode) {
  for (const int stripes : {20, 30, 45}) {
    const test::GridScene scene{.stripes = stripes, .noise_px = 0};
    const Frame3D frame = test::never_alike_frame(scene);
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    const auto back = decode_frame(*encoder.encode(frame, grid_options()));
    ASSERT_TRUE(back) << stripes << ": " << back.error().message;
    expect_same(scene, frame.surface, back->surface, 4);
  }
}

/// As reconstructions of small pictures are: of any shape, with holes anywhere.
TEST(Grid, SurfacesWithHolesAnywhereDecode) {
  test::Random random(11);
  for (int round = 0; round < 60; ++round) {
    const test::GridScene scene{.width = 160,
                                .height = 120,
                                .stripes = 4 + static_cast<int>(random.below(40)),
                                .seed = static_cast<std::uint64_t>(round + 1),
                                .quality = round % 2 == 1};
    Frame3D frame = test::grid_frame(scene);
    const auto holes = static_cast<std::uint32_t>(random.below(12));
    const int from = static_cast<int>(random.below(40)), to = from + static_cast<int>(random.below(60));
    test::drop_vertices(
        frame, [&](const GridPoint& p) { return random.below(12) < holes || p.line < from || p.line > to; });
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    const auto back = decode_frame(*encoder.encode(frame, grid_options()));
    ASSERT_TRUE(back) << round << ": " << back.error().message;
    ASSERT_EQ(back->surface.positions.size(), frame.surface.positions.size()) << round;
    ASSERT_EQ(back->surface.triangles.size(), frame.surface.triangles.size()) << round;
  }
}

TEST(Grid, ReconstructionsOwnTrianglesFaceTheCamera) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto back = decode_frame(*encoder.encode(test::grid_frame(scene), grid_options(6)));
  ASSERT_TRUE(back);
  for (const Triangle& t : back->surface.triangles) {
    const GridPoint& a = back->surface.grid[t[0]];
    const GridPoint& b = back->surface.grid[t[1]];
    const GridPoint& c = back->surface.grid[t[2]];
    // x right, y down: counter-clockwise as seen is a negative turn.
    const int turn =
        (b.boundary - a.boundary) * (c.line - a.line) - (b.line - a.line) * (c.boundary - a.boundary);
    ASSERT_LT(turn, 0);
  }
}

TEST(Grid, SigmasAndMarksComeBack) {
  const test::GridScene scene{.quality = true};
  const Frame3D frame = test::grid_frame(scene);
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto back = decode_frame(*encoder.encode(frame, grid_options()));
  ASSERT_TRUE(back) << back.error().message;
  const Surface& got = back->surface;
  ASSERT_EQ(got.interpolated, frame.surface.interpolated);
  for (std::size_t i = 0; i < got.grid.size(); ++i) {
    const float sent = frame.surface.grid[i].sigma_px;
    // A column is rounded to a sixteenth of a pixel, too.
    const float with_rounding = sent > 0 ? std::hypot(sent, 1 / (16 * std::sqrt(12.F))) : 0;
    ASSERT_LE(std::fabs(got.grid[i].sigma_px - with_rounding), 0.1F * with_rounding) << i;
    ASSERT_EQ(got.sigmas_m[i] > 0, sent > 0);
  }
  // What is sent on is not rounded again.
  FrameEncoder relay(test::grid_rig(scene), test::grid_pattern(scene));
  const auto again = decode_frame(*relay.encode(*back, grid_options()));
  ASSERT_TRUE(again) << again.error().message;
  for (std::size_t i = 0; i < got.grid.size(); ++i)
    ASSERT_EQ(again->surface.grid[i].sigma_px, got.grid[i].sigma_px) << i;
  // A tenth of a pixel at 1 m is about half a millimetre for this rig.
  const float z = got.positions[1000][2];
  const float expected = got.grid[1000].sigma_px * z * z / (820 * 0.2F);
  EXPECT_NEAR(got.sigmas_m[1000] / expected, 1, 0.35);
  auto options = grid_options();
  options.quality = false;
  EXPECT_TRUE(decode_frame(*encoder.encode(frame, options))->surface.sigmas_m.empty());
}

TEST(Grid, DeltaFramesBuildOnTheirKeyFrame) {
  test::GridScene scene;
  EncodeOptions options = grid_options();
  options.key_interval = 4;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  std::vector<Bytes> sent;
  std::vector<Frame3D> frames;
  for (int i = 0; i < 9; ++i) {
    scene.seed = static_cast<std::uint64_t>(i + 1);
    scene.shift_px = 0.7F * static_cast<float>(i);
    frames.push_back(test::grid_frame(scene));
    sent.push_back(*encoder.encode(frames.back(), options));
    EXPECT_EQ(is_key_frame(sent.back()), i % 4 == 0) << i;
  }
  FrameDecoder all;
  FrameDecoder some;  // every third is lost, but no key frame
  for (std::size_t i = 0; i < sent.size(); ++i) {
    const auto frame = all.decode(sent[i]);
    ASSERT_TRUE(frame) << frame.error().message;
    expect_same(scene, frames[i].surface, frame->surface, 4);
    if (i % 3 == 2) continue;
    const auto again = some.decode(sent[i]);
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again->surface.positions, frame->surface.positions);
  }
  // Who joins late waits for the next key frame, and can know it.
  FrameDecoder late;
  EXPECT_FALSE(late.can_decode(sent[2]));
  EXPECT_NE(late.decode(sent[2]).error().message.find("key frame"), std::string::npos);
  EXPECT_FALSE(decode_frame(sent[3]).ok());
  EXPECT_TRUE(late.can_decode(sent[4]));
  ASSERT_TRUE(late.decode(sent[4]).ok());
  EXPECT_TRUE(late.can_decode(sent[5]));
  EXPECT_FALSE(late.can_decode(sent[2]));
  ASSERT_TRUE(late.decode(sent[5]).ok());
  ASSERT_FALSE(late.decode(sent[2]).ok()) << "of another key frame";
  FrameDecoder seeking;
  ASSERT_TRUE(seeking.remember(sent[4]).ok());
  EXPECT_TRUE(seeking.decode(sent[6]).ok());
}

/// At 0.3 px of noise, on our scene nearest to that on which MPEG G-PCC (TMC13) was measured: 91 stripes, 240
/// lines. It took 11.7 bits a vertex, with inter prediction 11.3 (docs/BENCHMARKS.md).
TEST(Grid, NoisyFramesTakeHalfTheBitsOfGPcc) {
  for (const int key_interval : {1, 10}) {
    test::GridScene scene{.stripes = 91, .noise_px = 0.52F};  // uniform
    EncodeOptions options = grid_options();
    options.key_interval = key_interval;
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    double bits = 0, vertices = 0;
    for (scene.seed = 1; scene.seed <= 10; ++scene.seed) {
      const auto frame = encoder.encode(test::grid_frame(scene), options);
      ASSERT_TRUE(frame) << frame.error().message;
      bits += 8.0 * static_cast<double>(frame->size());
      vertices += read_frame_header(*frame)->vertices;
    }
    EXPECT_GT(vertices, 180'000);
    RecordProperty("bits_per_vertex_" + std::to_string(key_interval), std::to_string(bits / vertices));
    EXPECT_LT(bits / vertices, key_interval == 1 ? 11.7 / 2 : 11.3 / 2);
  }
}

TEST(Grid, AKeyFrameComesWhenAskedFor) {
  const test::GridScene scene;
  EncodeOptions options = grid_options();
  options.key_interval = 100;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const Frame3D frame = test::grid_frame(scene);
  EXPECT_TRUE(is_key_frame(*encoder.encode(frame, options)));
  const Bytes still = *encoder.encode(frame, options);
  EXPECT_FALSE(is_key_frame(still));
  encoder.request_key_frame();
  const Bytes key = *encoder.encode(frame, options);
  EXPECT_TRUE(is_key_frame(key));
  EXPECT_LT(still.size() * 3, key.size()) << "of a surface that stands still nothing is left to say";
}

TEST(Grid, EverySecondLineIsAKeyFrameAndItsOwnSurface) {
  for (const bool estimate : {false, true}) {
    const test::GridScene scene{.stripes = 40};
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    FrameDecoder decoder;
    EncodeOptions options{.geometry = GeometryCodec::kGrid, .estimate = estimate, .key_interval = 100};
    std::vector<std::size_t> vertices;
    std::vector<bool> keys;
    for (const auto& [halves, step_bits] :
         {std::pair(false, 6), {false, 6}, {true, 6}, {true, 6}, {true, 4}, {true, 4}, {false, 4}}) {
      options.halve_lines = halves;
      options.step_bits = step_bits;
      const auto bytes = encoder.encode(test::grid_frame(scene), options);
      ASSERT_TRUE(bytes) << bytes.error().message;
      keys.push_back(is_key_frame(*bytes));
      const auto decoded = decoder.decode(*bytes);
      ASSERT_TRUE(decoded) << decoded.error().message;
      const Surface& s = decoded->surface;
      vertices.push_back(s.positions.size());
      EXPECT_GT(s.triangles.size(), s.positions.size());
      for (std::size_t i = 0; i < s.positions.size(); ++i) {
        const float row = s.texture_coordinates[i][1] * static_cast<float>(scene.height) - 0.5F;
        ASSERT_NEAR(row, static_cast<float>(s.grid[i].line * (halves ? 4 : 2)), 0.01F);
      }
    }
    EXPECT_EQ(keys, (std::vector{true, false, true, false, true, false, true}));
    EXPECT_NEAR(static_cast<double>(vertices[2]), static_cast<double>(vertices[0]) / 2,
                0.02 * static_cast<double>(vertices[0]));
    EXPECT_EQ(vertices[6], vertices[0]);
  }
}

TEST(Grid, AMeshHasEverySecondLineToo) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  EncodeOptions options;
  const auto whole = encoder.encode(test::grid_frame(scene), options);
  options.halve_lines = true;
  const auto half = encoder.encode(test::grid_frame(scene), options);
  ASSERT_TRUE(whole && half);
  EXPECT_NEAR(read_frame_header(*half)->vertices, read_frame_header(*whole)->vertices / 2.0, 300);
}

TEST(Grid, WhatLiesOnNoGridGoesAsAMesh) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto codec_of = [&](const Frame3D& frame) {
    const auto bytes = encoder.encode(frame, grid_options());
    EXPECT_TRUE(bytes) << bytes.error().message;
    EXPECT_TRUE(decode_frame(*bytes).ok());
    return read_frame_header(*bytes)->geometry;
  };
  EXPECT_EQ(codec_of(test::frame(20, 20)), GeometryCodec::kDracoMesh);  // no places
  Frame3D twice = test::grid_frame(scene);
  twice.surface.grid[5] = twice.surface.grid[6];
  EXPECT_EQ(codec_of(twice), GeometryCodec::kDracoMesh);
  Frame3D across = test::grid_frame(scene);
  across.surface.triangles.push_back({0, 1, static_cast<std::uint32_t>(across.surface.positions.size() - 1)});
  EXPECT_EQ(codec_of(across), GeometryCodec::kDracoMesh);
  EXPECT_EQ(codec_of(Frame3D{}), GeometryCodec::kDracoMesh);
  EXPECT_EQ(codec_of(test::grid_frame(scene)), GeometryCodec::kGrid);
}

TEST(Grid, APositionThatIsNotFiniteIsRefusedAndWhatDoesNotGoIsNotLookedAt) {
  const test::GridScene scene;
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  Frame3D frame = test::grid_frame(scene);
  frame.surface.normals.assign(frame.surface.positions.size(),
                               {0, 0, std::numeric_limits<float>::infinity()});
  const auto bytes = encoder.encode(frame, grid_options());
  ASSERT_TRUE(bytes) << bytes.error().message;
  EXPECT_EQ(read_frame_header(*bytes)->geometry, GeometryCodec::kGrid);
  frame.surface.positions[frame.surface.positions.size() / 2][1] = std::numeric_limits<float>::quiet_NaN();
  const auto refused = encoder.encode(frame, grid_options());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("not finite"), std::string::npos);
}

TEST(Grid, TheOrderOfTrianglesChangesNothingAndWrongOnesAreFoundAnywhere) {
  const test::GridScene scene{.quality = true};
  Frame3D frame = test::grid_frame(scene);
  const GridCalibration calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  std::vector<Triangle>& triangles = frame.surface.triangles;
  const std::vector<Triangle> in_rows = triangles;
  StripeGrid one, other;
  ASSERT_TRUE(to_grid(frame.surface, calibration, {.with_quality = true}, one).ok());
  std::ranges::reverse(triangles);  // no cell follows its left neighbour
  ASSERT_TRUE(to_grid(frame.surface, calibration, {.with_quality = true}, other).ok());
  EXPECT_EQ(one.cells, other.cells);
  EXPECT_EQ(one.triangles, in_rows.size());
  EXPECT_EQ(other.triangles, in_rows.size());
  const auto vertices = static_cast<std::uint32_t>(frame.surface.positions.size());
  test::Random random(6);
  for (int round = 0; round < 200; ++round) {
    triangles = in_rows;
    const auto at = static_cast<std::size_t>(random.below(static_cast<std::uint32_t>(in_rows.size())));
    switch (round % 3) {
      case 0:
        triangles[at][random.below(3)] = vertices + random.below(2);
        break;
      case 1:
        triangles[at][random.below(3)] = (triangles[at][0] + vertices / 2) % vertices;  // in another cell
        break;
      default:
        triangles.insert(triangles.begin() + static_cast<std::ptrdiff_t>(at), in_rows[at]);
    }
    EXPECT_FALSE(to_grid(frame.surface, calibration, {.with_quality = true}, other).ok())
        << round << ' ' << at;
  }
}

TEST(Grid, SlicesAreTheSameInParallel) {
  const test::GridScene scene{.quality = true};
  const Frame3D frame = test::grid_frame(scene);
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  WorkerPool pool(3);
  StripeGrid one, other;
  ASSERT_TRUE(to_grid(frame.surface, calibration, {.with_quality = true}, one).ok());
  ASSERT_TRUE(to_grid(frame.surface, calibration, {.with_quality = true}, other).ok());
  GridEncoder encoder;
  const Bytes serial = encoder.encode(one, calibration, nullptr, {}, 0, {.slice_lines = 20});
  EXPECT_EQ(encoder.encode(other, calibration, nullptr, {}, 0, {.slice_lines = 20, .pool = &pool}), serial);
  GridDecoder decoder;
  StripeGrid a, b;
  ASSERT_TRUE(decoder.decode(serial, one.vertices, one.triangles, nullptr, a).ok());
  ASSERT_TRUE(decoder.decode(serial, one.vertices, one.triangles, nullptr, b, &pool).ok());
  EXPECT_EQ(a.columns, b.columns);
  EXPECT_EQ(a.cells, b.cells);
  EXPECT_EQ(a.columns, one.columns);
}

TEST(Grid, ALostSliceTakesNothingElseWithIt) {
  const test::GridScene scene;
  const Frame3D frame = test::grid_frame(scene);
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  StripeGrid whole;
  ASSERT_TRUE(to_grid(frame.surface, calibration, {}, whole).ok());
  GridEncoder encoder;
  const Bytes bytes = encoder.encode(whole, calibration, nullptr, {}, 0, {.slice_lines = 60});
  // Cut slice 2 (of 4) out: its size becomes 0.
  std::vector<std::uint32_t> sizes(4);
  std::size_t sum = 0, at = bytes.size();
  for (std::size_t table = 30; table + 16 < bytes.size(); ++table) {
    std::memcpy(sizes.data(), bytes.data() + table, 16);
    sum = std::size_t{0} + sizes[0] + sizes[1] + sizes[2] + sizes[3];
    if (table + 16 + sum == bytes.size()) {
      at = table;
      break;
    }
  }
  ASSERT_LT(at, bytes.size());
  Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(at + 16 + sizes[0] + sizes[1]));
  cut.insert(cut.end(), bytes.end() - static_cast<std::ptrdiff_t>(sizes[3]), bytes.end());
  std::fill_n(cut.begin() + static_cast<std::ptrdiff_t>(at + 8), 4, std::uint8_t{0});
  StripeGrid got;
  const auto head = GridDecoder().decode(cut, whole.vertices, whole.triangles, nullptr, got);
  ASSERT_TRUE(head) << head.error().message;
  std::uint32_t vertices = 0;
  for (int line = 0; line < whole.lines; ++line) {
    const bool lost = line >= 120 && line < 180;
    for (int b = 0; b < whole.boundaries; ++b) {
      const std::int32_t column = got.columns[got.at(line, b)];
      EXPECT_EQ(column, lost ? StripeGrid::kAbsent : whole.columns[whole.at(line, b)]);
      vertices += column != StripeGrid::kAbsent;
    }
  }
  EXPECT_EQ(got.vertices, vertices);
  Surface surface;
  ASSERT_TRUE(GridPoints(head->calibration).to_surface(got, surface).ok());
  EXPECT_EQ(surface.triangles.size(), got.triangles);
  for (const Triangle& t : surface.triangles)
    for (const std::uint32_t v : t) ASSERT_LT(v, vertices);
}

}  // namespace
}  // namespace relievo
