// SPDX-License-Identifier: Apache-2.0
// Proves: where a line sees a boundary twice, both places come back, with the triangles between them and
// those that go on from first places; such grids follow and precede others in one stream.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "codec/draco_grid.h"
#include "codec/frame3d_codec.h"
#include "codec/grid_coder.h"
#include "codec/grid_points.h"
#include "codec/reduce.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

using test::GridScene;
using Place = std::pair<int, int>;  // line and boundary

int lines_of(const GridScene& scene) {
  return scene.height / 2;
}

std::size_t seconds_of(const Surface& surface, int lines) {
  std::size_t count = 0;
  for (const GridPoint& p : surface.grid) count += p.line >= lines ? 1 : 0;
  return count;
}

/// How many triangles each cell holds. First places of triangles with second ones count as second ones.
std::map<Place, int> cells_of(const Surface& surface, int lines) {
  std::map<Place, int> out;
  for (const Triangle& t : surface.triangles) {
    bool is_second = false;
    for (const std::uint32_t v : t) is_second = is_second || surface.grid[v].line >= lines;
    Place cell{1 << 20, 1 << 20};
    for (const std::uint32_t v : t) {
      const GridPoint& p = surface.grid[v];
      cell.first = std::min(cell.first, p.line + (is_second && p.line < lines ? lines : 0));
      cell.second = std::min<int>(cell.second, p.boundary);
    }
    ++out[cell];
  }
  return out;
}

/// Every vertex that was sent is there, where it was; others are copies of first ones. `step_px`: at most
/// that far off.
void expect_same(const GridScene& scene, const Surface& sent, const Surface& got, float step_px) {
  const int lines = lines_of(scene);
  std::map<Place, std::size_t> there;
  for (std::size_t i = 0; i < got.grid.size(); ++i) {
    const Place place{got.grid[i].line, got.grid[i].boundary};
    ASSERT_TRUE(i == 0 || Place(got.grid[i - 1].line, got.grid[i - 1].boundary) < place) << "in order";
    there[place] = i;
  }
  for (std::size_t i = 0; i < sent.grid.size(); ++i) {
    const auto found = there.find({sent.grid[i].line, sent.grid[i].boundary});
    ASSERT_NE(found, there.end()) << i;
    const std::size_t g = found->second;
    EXPECT_NEAR(got.grid[g].column_px, sent.grid[i].column_px, step_px) << i;
    EXPECT_NEAR(got.positions[g][2], sent.positions[i][2], 0.1F * step_px * sent.positions[i][2]) << i;
    EXPECT_NEAR(got.texture_coordinates[g][1], sent.texture_coordinates[i][1], 1e-6F) << i;
    if (!got.interpolated.empty()) {
      EXPECT_EQ(got.interpolated[g], sent.interpolated[i]) << i;
    }
    there.erase(found);
  }
  for (const auto& [place, g] : there) {
    ASSERT_GE(place.first, lines);
    const auto first = std::ranges::find_if(got.grid, [&](const GridPoint& p) {
      return p.line == place.first - lines && p.boundary == place.second;
    });
    ASSERT_NE(first, got.grid.end());
    const auto f = static_cast<std::size_t>(first - got.grid.begin());
    EXPECT_EQ(got.grid[g].column_px, first->column_px);
    EXPECT_EQ(got.grid[g].sigma_px, first->sigma_px);
    EXPECT_EQ(got.positions[g], got.positions[f]);
    EXPECT_EQ(got.texture_coordinates[g], got.texture_coordinates[f]);
  }
  EXPECT_EQ(cells_of(got, lines), cells_of(sent, lines));
  for (const Triangle& t : got.triangles)
    for (const std::uint32_t v : t)
      EXPECT_FALSE(there.contains({got.grid[v].line, got.grid[v].boundary})) << "joined, not side by side";
}

struct Case {
  const char* name;
  GridScene scene;
  EncodeOptions options;
};

class TwiceRoundTrip : public testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(
    Scenes, TwiceRoundTrip,
    testing::Values(Case{"plain", {}, {.geometry = GeometryCodec::kGrid}},
                    Case{"lenses", {.distorts = true}, {.geometry = GeometryCodec::kGrid}},
                    Case{"quality", {.quality = true}, {.geometry = GeometryCodec::kGrid}},
                    Case{"slices", {}, {.geometry = GeometryCodec::kGrid, .slice_lines = 32}},
                    Case{"draco", {.quality = true}, {.geometry = GeometryCodec::kDracoGrid}},
                    Case{"metric", {.quality = true}, {.geometry = GeometryCodec::kGrid, .estimate = true}},
                    Case{"visual", {}, {.geometry = GeometryCodec::kGrid, .bound_px = 0.5F}}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(TwiceRoundTrip, KeepsBothPlacesAndWhatJoinsThem) {
  const auto& [name, scene, options] = GetParam();
  const Frame3D frame = test::twice_frame(scene);
  ASSERT_GT(seconds_of(frame.surface, lines_of(scene)), 50U);
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto bytes = encoder.encode(frame, options);
  ASSERT_TRUE(bytes) << bytes.error().message;
  EXPECT_EQ(read_frame_header(*bytes)->geometry, options.geometry);
  const auto back = decode_frame(*bytes);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_GT(back->surface.positions.size(), frame.surface.positions.size()) << "copies at the seam";
  const float step_px = options.bound_px > 0 ? options.bound_px : options.estimate ? 0.5F : 1.F / 16;
  expect_same(scene, frame.surface, back->surface, step_px);
}

TEST(GridTwice, ComeAndGoInOneStreamWithOneKeyFrameMore) {
  for (const bool estimate : {false, true}) {
    const GridScene scene{.quality = true};
    EncodeOptions options{.geometry = GeometryCodec::kGrid, .estimate = estimate, .key_interval = 100};
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    FrameDecoder decoder;
    std::vector<int> keys;
    for (int n = 0; n < 12; ++n) {
      GridScene now = scene;
      now.seed = static_cast<std::uint64_t>(n + 1);
      now.shift_px = 0.2F * static_cast<float>(n);
      const bool twice = (n >= 3 && n < 5) || n >= 8;
      const Frame3D frame = twice ? test::twice_frame(now) : test::grid_frame(now);
      const auto bytes = encoder.encode(frame, options);
      ASSERT_TRUE(bytes) << bytes.error().message;
      EXPECT_EQ(read_frame_header(*bytes)->geometry, GeometryCodec::kGrid);
      if (is_key_frame(*bytes)) keys.push_back(n);
      const auto back = decoder.decode(*bytes);
      ASSERT_TRUE(back) << back.error().message;
      expect_same(now, frame.surface, back->surface, estimate ? 0.7F : 1.F / 16);
    }
    EXPECT_EQ(keys, (std::vector<int>{0, 3}));
  }
}

TEST(GridTwice, ADeltaIsMuchSmallerThanItsKey) {
  const GridScene scene{.noise_px = 0};
  const EncodeOptions options{.geometry = GeometryCodec::kGrid, .key_interval = 100};
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  const auto key = encoder.encode(test::twice_frame(scene), options);
  const auto delta = encoder.encode(test::twice_frame(scene), options);
  ASSERT_TRUE(key && delta);
  EXPECT_LT(2 * delta->size(), key->size());
}

TEST(GridTwice, ReducedFramesHaveTheFirstPlacesAlone) {
  const GridScene scene{.quality = true};
  const int lines = lines_of(scene);
  const Frame3D twice = test::twice_frame(scene), once = test::grid_frame(scene);
  Surface expected, half;
  ASSERT_TRUE(halve_lines(once.surface, lines, expected));
  ASSERT_TRUE(halve_lines(twice.surface, lines, half));
  EXPECT_EQ(half.positions, expected.positions);
  EXPECT_EQ(half.sigmas_m, expected.sigmas_m);
  EXPECT_EQ(half.triangles, expected.triangles);

  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  StripeGrid a, b;
  ASSERT_TRUE(to_grid(once.surface, calibration, {.with_quality = true}, a));
  ASSERT_TRUE(to_grid(twice.surface, calibration, {.with_quality = true}, b));
  std::vector<std::uint8_t> plane(b.columns.size(), 1);
  halve_lines(a);
  halve_lines(b, std::array{&plane});
  EXPECT_FALSE(b.twice);
  EXPECT_EQ(a.lines, b.lines);
  EXPECT_EQ(a.columns, b.columns);
  EXPECT_EQ(a.cells, b.cells);
  EXPECT_EQ(a.sigmas, b.sigmas);
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(plane.size(), b.columns.size());

  // As the encoder does it, which then may go back.
  EncodeOptions options{.geometry = GeometryCodec::kGrid, .key_interval = 100};
  FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
  FrameDecoder decoder;
  for (int n = 0; n < 6; ++n) {
    options.halve_lines = n / 2 == 1;
    const auto bytes = encoder.encode(twice, options);
    ASSERT_TRUE(bytes);
    EXPECT_EQ(is_key_frame(*bytes), n % 2 == 0);
    const auto back = decoder.decode(*bytes);
    ASSERT_TRUE(back) << back.error().message;
    if (options.halve_lines) {
      EXPECT_EQ(back->surface.positions.size(), expected.positions.size());
      EXPECT_EQ(back->surface.triangles.size(), expected.triangles.size());
    } else {
      expect_same(scene, twice.surface, back->surface, 1.F / 16);
    }
  }
}

TEST(GridTwice, SurfacesThatAreNoSuchGridAreMeshes) {
  const GridScene scene{.quality = true};
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  const auto lines = static_cast<std::uint16_t>(calibration.lines());
  const Frame3D frame = test::twice_frame(scene);
  const std::size_t count = frame.surface.grid.size();
  const std::size_t firsts = count - seconds_of(frame.surface, lines);
  const auto refuses = [&](const char* why, const auto& change) {
    Frame3D other = test::twice_frame(scene);
    change(other.surface);
    for (const bool twice : {false, true}) {
      StripeGrid grid;
      EXPECT_FALSE(to_grid(other.surface, calibration, {.twice = twice}, grid).ok()) << why;
    }
    FrameEncoder encoder(test::grid_rig(scene), test::grid_pattern(scene));
    const auto bytes = encoder.encode(other, {.geometry = GeometryCodec::kGrid});
    if (bytes) {
      EXPECT_EQ(read_frame_header(*bytes)->geometry, GeometryCodec::kDracoMesh) << why;
    }
  };
  const auto place = [](const Surface& s, std::size_t v) {
    return Place(s.grid[v].line, s.grid[v].boundary);
  };
  refuses("second places before first ones", [&](Surface& s) { std::swap(s.grid[0], s.grid[count - 1]); });
  refuses("second places in between", [&](Surface& s) { std::swap(s.grid[firsts - 9], s.grid[firsts]); });
  refuses("triangles in between", [&](Surface& s) { std::swap(s.triangles.front(), s.triangles.back()); });
  refuses("two at one second place", [&](Surface& s) { s.grid[firsts] = s.grid[firsts + 1]; });
  refuses("a line beyond",
          [&](Surface& s) { s.grid[count - 1].line = static_cast<std::uint16_t>(2 * lines); });
  refuses("a boundary beyond", [&](Surface& s) { s.grid[count - 1].boundary = 999; });
  refuses("a triangle twice", [&](Surface& s) { s.triangles.push_back(s.triangles.back()); });
  refuses("a triangle on nothing", [&](Surface& s) { s.triangles.back()[1] = 1U << 30; });
  refuses("a triangle across", [&](Surface& s) { s.triangles.back()[1] = 0; });
  refuses("a copy where there is a second place", [&](Surface& s) {
    // Of a triangle with two second places, one becomes the first place there.
    for (Triangle& t : s.triangles)
      for (std::uint32_t& v : t) {
        if (v < firsts || t[0] < firsts || t[1] < firsts) continue;
        for (std::uint32_t f = 0; f < firsts; ++f)
          if (place(s, f) == Place(s.grid[v].line - lines, s.grid[v].boundary)) v = f;
        return;
      }
  });
}

TEST(GridTwice, VerticesTooFarAwayGoWithTheirCopies) {
  const GridScene scene;
  const auto calibration = grid_calibration(test::grid_rig(scene), test::grid_pattern(scene));
  Frame3D frame = test::twice_frame(scene);
  const std::size_t firsts = frame.surface.grid.size() - seconds_of(frame.surface, calibration.lines());
  StripeGrid whole, grid;
  ASSERT_TRUE(to_grid(frame.surface, calibration, {}, whole));
  const Triangle& last = frame.surface.triangles.back();
  std::uint32_t seam = ~0U;
  for (const Triangle& t : frame.surface.triangles)
    if (t[0] >= firsts || t[1] >= firsts || t[2] >= firsts) seam = std::min({seam, t[0], t[1], t[2]});
  ASSERT_LT(seam, firsts);
  for (const std::uint32_t v : {seam, std::max({last[0], last[1], last[2]})})
    frame.surface.positions[v][2] = 1e6F;
  ASSERT_TRUE(to_grid(frame.surface, calibration, {}, grid));
  EXPECT_LT(grid.vertices, whole.vertices - 2);
  std::uint32_t vertices = 0;
  for (const std::int32_t c : grid.columns) vertices += c != StripeGrid::kAbsent;
  EXPECT_EQ(grid.vertices, vertices);
  const GridPoint& p = frame.surface.grid[seam];
  EXPECT_EQ(grid.columns[grid.at(p.line + calibration.lines(), p.boundary)], StripeGrid::kAbsent);
}

struct Coded {
  Bytes bytes;
  std::uint32_t vertices = 0, triangles = 0;
};

Coded coded(StripeGrid& grid, const GridCalibration& calibration, const GridKey* key) {
  Coded out;
  out.bytes = GridEncoder().encode(grid, calibration, key, {}, 1, {.slice_lines = 24});
  out.vertices = grid.vertices;
  out.triangles = grid.triangles;
  return out;
}

void set_lines(Bytes& bytes, int lines) {
  const auto value = static_cast<std::uint16_t>(lines);
  std::memcpy(bytes.data() + 4, &value, 2);
}

constexpr std::uint8_t kTwice = 8;
const GridScene kSmall{.width = 320, .height = 144, .stripes = 27, .distorts = true, .quality = true};

/// A key grid and a delta grid that builds on it, both with second places.
class HostileGridTwice : public ::testing::Test {
 protected:
  void SetUp() override {
    const Surface surface = test::twice_frame(kSmall).surface;
    ASSERT_TRUE(to_grid(surface, calibration, {.with_quality = true}, key.grid));
    good = coded(key.grid, calibration, nullptr);
    key.id = grid_id(good.bytes);
    ASSERT_TRUE(to_grid(surface, calibration, {.with_quality = true}, next));
    delta = coded(next, calibration, &key);
  }

  const GridCalibration calibration = grid_calibration(test::grid_rig(kSmall), test::grid_pattern(kSmall));
  GridKey key;
  StripeGrid next;  // what `delta` is of
  Coded good, delta;
};

TEST_F(HostileGridTwice, FlagLinesAndKeyMustAgree) {
  StripeGrid out;
  EXPECT_EQ(good.bytes[0] & kTwice, kTwice);
  GridDecoder decoder;
  const auto decodes = [&](const Coded& frame, const auto& change) {
    Bytes bytes = frame.bytes;
    change(bytes);
    return decoder.decode(bytes, frame.vertices, frame.triangles, &key, out).ok();
  };
  const auto unflag = [](Bytes& bytes) { bytes[0] ^= kTwice; };
  ASSERT_TRUE(decodes(good, [](Bytes&) {}));
  ASSERT_TRUE(out.twice);
  EXPECT_FALSE(decodes(good, unflag)) << "twice the lines without the flag";
  EXPECT_FALSE(decodes(good, [&](Bytes& b) { set_lines(b, calibration.lines()); })) << "half of the lines";
  EXPECT_FALSE(decodes(good, [&](Bytes& b) { set_lines(b, 2 * calibration.lines() - 1); }))
      << "an odd number";
  EXPECT_FALSE(decodes(good, [&](Bytes& b) { set_lines(b, 2 * calibration.lines() + 2); }));
  EXPECT_FALSE(decodes(good, [](Bytes& b) { b[0] |= 16; })) << "an unknown flag";
  ASSERT_TRUE(decodes(delta, [](Bytes&) {}));
  EXPECT_EQ(out.columns, next.columns);
  EXPECT_FALSE(decodes(delta, unflag)) << "not as its key grid";

  StripeGrid once;
  ASSERT_TRUE(to_grid(test::grid_frame(kSmall).surface, calibration, {.with_quality = true}, once));
  const Coded other = coded(once, calibration, nullptr);
  ASSERT_TRUE(decodes(other, [](Bytes&) {}));
  EXPECT_FALSE(decodes(other, unflag)) << "the flag without the lines";
  const GridKey of_other_size{.id = grid_id(other.bytes), .grid = once};
  EXPECT_FALSE(decoder.decode(delta.bytes, delta.vertices, delta.triangles, &of_other_size, out).ok());
}

TEST_F(HostileGridTwice, TrianglesFromTheLastLineToTheFirstOneAreRefused) {
  for (const bool joins : {false, true}) {
    StripeGrid grid;
    ASSERT_TRUE(to_grid(test::grid_frame(kSmall).surface, calibration, {.twice = true}, grid));
    const int last = calibration.lines() - 1;
    for (const int line : {last, last + 1})
      for (const int b : {4, 5}) grid.columns[grid.at(line, b)] = 16 * (40 + 10 * b);
    if (joins) grid.cells[grid.at(last, 4)] = grid_cell::kStraight;
    StripeGrid copy = grid, out;
    const Coded sent = coded(grid, calibration, nullptr);
    EXPECT_EQ(GridDecoder().decode(sent.bytes, sent.vertices, sent.triangles, nullptr, out).ok(), !joins);
    const auto draco = encode_draco_grid(copy, calibration, {}, 1);
    ASSERT_TRUE(draco);
    EXPECT_EQ(decode_draco_grid(*draco, copy.vertices, copy.triangles, out).ok(), !joins);
  }
}

TEST_F(HostileGridTwice, MutatedBytesGiveAnErrorOrAGrid) {
  test::Random random(12);
  GridDecoder decoder;
  int decoded = 0;
  for (int i = 0; i < 1500; ++i) {
    const Coded& from = i % 2 == 0 ? good : delta;
    Bytes bytes = from.bytes;
    for (std::uint32_t k = 0; k < 1 + static_cast<std::uint32_t>(i) % 3; ++k)
      bytes[random.below(static_cast<std::uint32_t>(random.below(3) == 0 ? 200 : bytes.size()))] =
          static_cast<std::uint8_t>(random.below(256));
    StripeGrid grid;
    const auto head = decoder.decode(bytes, from.vertices, from.triangles, &key, grid);
    if (!head) continue;
    ++decoded;
    Surface surface;
    if (!GridPoints(head->is_key ? head->calibration : calibration).to_surface(grid, surface)) continue;
    ASSERT_EQ(surface.positions.size(), grid.vertices);
    ASSERT_EQ(surface.triangles.size(), grid.triangles);
    for (const Triangle& t : surface.triangles)
      for (const std::uint32_t v : t) ASSERT_LT(v, grid.vertices);
  }
  EXPECT_GT(decoded, 10);
}

}  // namespace
}  // namespace relievo
