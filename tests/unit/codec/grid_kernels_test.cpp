// SPDX-License-Identifier: Apache-2.0
// Every implementation of a kernel of the stripe grid gives what the portable one gives, of likely and of
// extreme input.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <optional>
#include <utility>

#include "codec/gather_kernels.h"
#include "codec/grid_predict.h"
#include "codec/grid_symbols.h"
#include "codec/point_kernels.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"
#include "tests/support/make_grid.h"

namespace relievo {
namespace {

TEST(GridKernels, PredictionsAndContextsAgree) {
  test::Random random(3);
  constexpr int kPlaces = 136;
  constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
  for (int round = 0; round < 200; ++round) {
    std::array<std::vector<std::int32_t>, 6> rows;
    const bool extreme = round % 4 == 0;
    for (auto& row : rows)
      for (int i = 0; i < kPlaces; ++i)
        row.push_back(random.below(6) == 0
                          ? kAbsent
                          : static_cast<std::int32_t>(random.below(extreme ? 1U << 22 : 100)));
    const auto weight = [&] {
      return static_cast<std::int16_t>(static_cast<int>(random.below(2049)) - 1024);
    };
    const GridModel model{weight(), weight(), weight(),
                          weight(), weight(), static_cast<std::uint16_t>(random.below(4097)),
                          100};
    const bool key = round % 2 == 0;
    const GridRows in{rows[0].data(),
                      rows[1].data(),
                      rows[2].data(),
                      rows[3].data(),
                      key ? rows[4].data() : nullptr,
                      key ? rows[5].data() : nullptr};
    std::vector<std::uint8_t> sizes;
    for (int i = 0; i < kPlaces + 2; ++i) sizes.push_back(static_cast<std::uint8_t>(random.below(61)));
    std::vector<std::int32_t> reference(kPlaces), expected(kPlaces);
    std::vector<std::uint8_t> tables(kPlaces), other(kPlaces);
    const GridKernels& portable = all_grid_kernels().front();
    portable.predict(in, model, kPlaces, reference.data());
    portable.contexts(sizes.data() + 1, in.up1, kPlaces, tables.data());
    for (const GridKernels& kernels : all_grid_kernels()) {
      kernels.predict(in, model, kPlaces, expected.data());
      kernels.contexts(sizes.data() + 1, in.up1, kPlaces, other.data());
      ASSERT_EQ(expected, reference) << kernels.name;
      ASSERT_EQ(other, tables) << kernels.name;
    }
    GridSlopes slopes;
    portable.slopes(rows[4].data(), in, model.limit, kPlaces - 3, slopes);
    std::vector<std::uint8_t> there(kPlaces);
    portable.there(in.up1, kPlaces, there.data());
    for (const GridKernels& kernels : all_grid_kernels()) {
      GridSlopes sums;
      kernels.slopes(rows[4].data(), in, model.limit, kPlaces - 3, sums);
      ASSERT_EQ(sums, slopes) << kernels.name;
      kernels.there(in.up1, kPlaces, other.data());
      ASSERT_EQ(other, there) << kernels.name;
    }
  }
}

/// What a kernel may have written, for comparing.
struct LineOutput {
  std::vector<std::int32_t> columns;
  std::vector<std::uint8_t> sizes, kinds;
  std::vector<std::uint16_t> codes;
  std::vector<std::uint8_t> cells;
  bool fair = true;
  bool operator==(const LineOutput&) const = default;
};

TEST(GridKernels, ResidualsAndColumnsAgreeAndAreEachOthersReverse) {
  test::Random random(4);
  constexpr int kPlaces = 72;
  constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
  for (int round = 0; round < 200; ++round) {
    const std::uint32_t range = round % 4 == 0 ? 1U << 22 : 30;
    std::vector<std::int32_t> up1, expected, here;
    std::vector<std::uint8_t> tolerance, tables, sizes, there, cells;
    for (int i = 0; i < kPlaces; ++i) {
      const auto column = [&] {
        return random.below(6) == 0 ? kAbsent : static_cast<std::int32_t>(random.below(range)) - 10;
      };
      up1.push_back(column());
      expected.push_back(up1.back() + static_cast<std::int32_t>(random.below(3)));
      here.push_back(column());
      there.push_back(here.back() != kAbsent);
      tolerance.push_back(static_cast<std::uint8_t>(random.below(8)));
      tables.push_back(static_cast<std::uint8_t>(up1.back() == kAbsent ? kAloneTable : random.below(7)));
      sizes.push_back(static_cast<std::uint8_t>(random.below(61)));
      cells.push_back(random.below(2) == 0 ? kBothTriangles : static_cast<std::uint8_t>(random.below(16)));
    }
    std::optional<LineOutput> reference, reverse;
    for (const GridKernels& kernels : all_grid_kernels()) {
      LineOutput out{here, sizes, sizes, std::vector<std::uint16_t>(kPlaces), cells};
      kernels.residuals({.up1 = up1.data(),
                         .expected = expected.data(),
                         .tolerance = round % 2 == 0 ? tolerance.data() : nullptr,
                         .tables = tables.data(),
                         .columns = out.columns.data(),
                         .sizes = out.sizes.data(),
                         .codes = out.codes.data(),
                         .kinds = out.kinds.data()},
                        kPlaces);
      kernels.diagonals(up1.data(), here.data(), 20, kPlaces - 1, out.cells.data());
      for (std::size_t i = 0; i < kPlaces; ++i) {
        ASSERT_EQ(out.kinds[i] == kNoVertex, there[i] == 0);
        if (out.kinds[i] != kDone) out.codes[i] = 0;
        ASSERT_LE(std::abs(out.columns[i] - here[i]), round % 2 == 0 ? tolerance[i] : 0);
      }
      if (!reference) reference = out;
      ASSERT_EQ(out, *reference) << kernels.name;

      LineOutput back{here, sizes, sizes, out.codes, {}};
      std::vector<std::uint8_t> symbols;
      for (std::size_t i = 0; i < kPlaces; ++i)
        symbols.push_back(out.kinds[i] == kDone ? static_cast<std::uint8_t>(out.codes[i] % rans::kMostSymbols)
                                                : kDirectSymbols);
      const std::int32_t most = round % 3 == 0 ? 20 : 1 << 23;
      back.fair = kernels.columns({.there = there.data(),
                                   .symbols = symbols.data(),
                                   .tables = tables.data(),
                                   .expected = expected.data(),
                                   .columns = back.columns.data(),
                                   .sizes = back.sizes.data(),
                                   .kinds = back.kinds.data()},
                                  most, kPlaces);
      ASSERT_EQ(back.kinds, out.kinds);
      ASSERT_EQ(back.sizes, out.sizes);
      bool fair = true;
      for (std::size_t i = 0; i < kPlaces; ++i) {
        ASSERT_EQ(back.columns[i], out.kinds[i] == kDone ? out.columns[i] : kAbsent);
        fair = fair && (out.kinds[i] != kDone || std::abs(out.columns[i]) <= most);
      }
      EXPECT_EQ(back.fair, fair);
      if (!reverse) reverse = back;
      ASSERT_EQ(back, *reverse) << kernels.name;
    }
  }
}

TEST(GridKernels, RaysAndSheetsAgree) {
  test::Random random(5);
  constexpr int kPlaces = 64;
  for (int round = 0; round < 50; ++round) {
    std::vector<std::int32_t> columns;
    std::array<std::vector<float>, 4> sheets;
    for (int i = 0; i < kPlaces; ++i) {
      columns.push_back(random.below(5) == 0 ? StripeGrid::kAbsent
                                             : static_cast<std::int32_t>(random.below(10000)));
      for (std::vector<float>& values : sheets)
        values.push_back(random.unit() + (round % 2 == 0 ? 0.1F : -0.01F));
    }
    std::optional<std::array<std::vector<float>, 5>> reference;
    std::optional<bool> met;
    for (const GridPointKernels& kernels : all_grid_point_kernels()) {
      std::array<std::vector<float>, 5> out;
      for (std::vector<float>& values : out) values.resize(kPlaces);
      auto& [column, x, y, slope, z] = out;
      kernels.straight_rays(columns.data(), {1 / 16.F, 1 / 800.F, 0.1F, 0.2F}, kPlaces, column.data(),
                            x.data(), y.data());
      const Sheets all{sheets[0].data(), sheets[1].data(), sheets[2].data(), sheets[3].data()};
      const bool good =
          kernels.meet({columns.data(), x.data(), y.data(), slope.data(), z.data()}, all, kPlaces);
      std::vector<float> z_alone(kPlaces);
      EXPECT_EQ(kernels.meet({columns.data(), x.data(), y.data(), nullptr, z_alone.data()}, all, kPlaces),
                good);
      EXPECT_EQ(z_alone, z) << "whether or not the slope is asked for";
      if (!reference) reference = out;
      if (!met) met = good;
      EXPECT_EQ(good, *met) << kernels.name;
      for (std::size_t k = 0; k < out.size(); ++k)
        for (std::size_t i = 0; i < kPlaces; ++i)
          ASSERT_TRUE(columns[i] == StripeGrid::kAbsent || out[k][i] == (*reference)[k][i]) << kernels.name;
    }
  }
}

/// Lines with vertices everywhere, nowhere and here and there, on which cells hold what they can.
struct TwoLines {
  static constexpr int kPlaces = 64;
  std::array<std::vector<std::int32_t>, 2> columns;
  std::vector<std::uint8_t> cells;

  explicit TwoLines(test::Random& random) : cells(kPlaces) {
    const std::uint32_t one_in = random.below(40);
    for (auto& line : columns)
      for (int b = 0; b < kPlaces; ++b)
        line.push_back(one_in == 0 || random.below(one_in + 1) == 0
                           ? StripeGrid::kAbsent
                           : static_cast<std::int32_t>(random.below(9999)));
    for (std::size_t b = 0; b + 1 < kPlaces; ++b) {
      int corners = 0;
      for (const auto& line : columns)
        for (const std::size_t c : {b, b + 1}) corners += line[c] != StripeGrid::kAbsent;
      if (corners < 4) continue;
      const auto any = static_cast<std::uint8_t>(random.below(20) == 0 ? 1U << random.below(4) : 0U);
      cells[b] = any != 0 || random.below(20) == 0 ? any
                 : random.below(2) == 0            ? grid_cell::kStraight
                                                   : grid_cell::kTurned;
    }
  }
};

TEST(GridKernels, VerticesAndTrianglesAgree) {
  test::Random random(6);
  for (int round = 0; round < 300; ++round) {
    const TwoLines lines(random);
    std::array<std::vector<float>, 4> values;
    for (auto& of : values)
      for (int b = 0; b < TwoLines::kPlaces; ++b) of.push_back(random.unit());
    std::optional<Surface> reference;
    for (const GridPointKernels& kernels : all_grid_point_kernels()) {
      Surface out;
      std::array<std::vector<std::int32_t>, 2> index;
      std::int32_t next = 5;
      for (std::size_t line = 0; line < 2; ++line) {
        index[line].resize(TwoLines::kPlaces + 1);
        const std::int32_t first = next;
        next = kernels.number(lines.columns[line].data(), TwoLines::kPlaces, first, index[line].data());
        index[line].back() = next;
        const auto so_many = static_cast<std::size_t>(next - first);
        out.positions.assign(so_many, {});
        out.texture_coordinates.assign(so_many, {});
        out.grid.assign(so_many, {});
      }
      kernels.vertices({.columns = lines.columns[1].data(),
                        .column_px = values[0].data(),
                        .ray_x = values[1].data(),
                        .ray_y = values[2].data(),
                        .z = values[3].data(),
                        .per_width = 0.01F,
                        .v = 0.5F,
                        .line = 300,
                        .position = out.positions.data(),
                        .coordinate = out.texture_coordinates.data(),
                        .place = out.grid.data()},
                       TwoLines::kPlaces);
      out.triangles.resize(2 * TwoLines::kPlaces);
      const int cells = TwoLines::kPlaces - 1 - round % 5;
      const Triangle* end = kernels.triangles({lines.cells.data(), index[0].data(), index[1].data()}, cells,
                                              out.triangles.data());
      out.triangles.resize(static_cast<std::size_t>(end - out.triangles.data()));
      if (reference) {
        ASSERT_EQ(out.positions, reference->positions) << kernels.name;
        ASSERT_EQ(out.texture_coordinates, reference->texture_coordinates) << kernels.name;
        ASSERT_EQ(out.triangles, reference->triangles) << kernels.name << ", round " << round;
        ASSERT_TRUE(std::ranges::equal(out.grid, reference->grid, [](const GridPoint& a, const GridPoint& b) {
          return a.boundary == b.boundary && a.line == b.line && a.column_px == b.column_px &&
                 a.sigma_px == 0 && !a.interpolated;
        })) << kernels.name;
      } else {
        reference = std::move(out);
      }
    }
  }
}

TEST(GridKernels, GatheringAgrees) {
  test::Random random(7);
  for (int round = 0; round < 40; ++round) {
    const test::GridScene scene{
        .width = 200, .height = 60, .stripes = 9 + static_cast<int>(random.below(40))};
    Frame3D frame = test::grid_frame(scene);
    test::drop_vertices(frame, [&](const GridPoint&) { return random.below(30) == 0; });
    Surface& s = frame.surface;
    if (s.grid.size() < 2) continue;
    const auto any = [&] { return random.below(static_cast<std::uint32_t>(s.grid.size())); };
    if (round % 5 == 1) s.grid[any()].column_px = round % 2 == 0 ? -0.6F : 200.5F;
    if (round % 5 == 2) s.grid[any()] = s.grid[any()];
    if (round % 5 == 3) s.grid[any()].boundary = static_cast<std::uint16_t>(scene.stripes - 1);
    if (round % 5 == 4) std::swap(s.grid[any()], s.grid[any()]);
    std::optional<std::pair<Gathered, std::vector<std::int32_t>>> reference;
    std::vector<std::uint8_t> right_of;
    for (const GatherKernels& kernels : all_gather_kernels()) {
      StripeGrid grid;
      grid.reset(scene.stripes - 1, scene.height / 2, 4);
      std::vector<std::uint8_t> right(s.grid.size() + kSpareRight);
      const Gathered done = kernels.vertices({.points = s.grid,
                                              .grid = grid,
                                              .lines = grid.lines - (round % 7 == 6 ? 3 : 0),
                                              .steps = 16,
                                              .width_px = 200,
                                              .right = right.data()});
      if (!reference) reference.emplace(done, grid.columns), right_of = right;
      ASSERT_EQ(done, reference->first) << kernels.name << ", round " << round;
      if (done == Gathered::kAll) {
        ASSERT_EQ(grid.columns, reference->second) << kernels.name;
        ASSERT_EQ(right, right_of) << kernels.name;
      }
      for (const float farthest : {0.F, s.positions[any()][2], 1e9F})
        EXPECT_EQ(kernels.reach(s.positions, farthest),
                  all_gather_kernels().front().reach(s.positions, farthest));
    }
  }
}

TEST(GridKernels, OnePositionThatIsFarOrNotFiniteIsFoundAnywhere) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const GatherKernels& kernels : all_gather_kernels()) {
    for (std::size_t count : {0, 1, 7, 8, 9, 24, 29}) {
      std::vector<Vec3f> positions(count, {1e9F, -1e9F, 1});
      EXPECT_EQ(kernels.reach(positions, 2), Reach::kNear) << kernels.name;
      for (std::size_t i = 0; i < 3 * count; ++i) {
        float& number = positions[i / 3][i % 3];
        const float before = std::exchange(number, 3.F);
        EXPECT_EQ(kernels.reach(positions, 2), i % 3 == 2 ? Reach::kFar : Reach::kNear) << kernels.name;
        for (const float endless : {kInfinity, -kInfinity, std::numeric_limits<float>::quiet_NaN()}) {
          number = endless;
          EXPECT_EQ(kernels.reach(positions, 2), Reach::kNotFinite) << kernels.name << ' ' << i;
        }
        number = before;
      }
    }
  }
}

/// Codes of any places are kept in order, and nothing is written behind the room that there must be.
TEST(GridKernels, PackingKeepsWhatIsDone) {
  test::Random random(10);
  constexpr std::uint16_t kUntouched = 0xffff;
  for (int round = 0; round < 400; ++round) {
    const std::uint32_t blocks = random.below(9), gaps = 1 + random.below(4);
    const std::size_t places = 8 * std::size_t{blocks};
    std::vector<std::uint16_t> codes, kept;
    std::vector<std::uint8_t> kinds;
    for (std::size_t i = 0; i < places; ++i) {
      codes.push_back(static_cast<std::uint16_t>(random.below(600)));
      kinds.push_back(static_cast<std::uint8_t>(random.below(gaps) == 0 ? 0 : 1 + random.below(2)));
      if (kinds.back() == kDone) kept.push_back(codes.back());
    }
    const int count = static_cast<int>(places) - (places > 0 ? static_cast<int>(random.below(8)) : 0);

    std::vector<GridCellBlock> cells(blocks);
    std::vector<std::uint16_t> said;
    for (GridCellBlock& block : cells) {
      block.whole = static_cast<std::uint16_t>(300 + random.below(2));
      block.says_whole = random.below(2) == 0 ? 1 : 0;
      if (block.says_whole != 0) said.push_back(block.whole);
      for (int i = 0; i < 8; ++i) {
        const std::uint64_t code = random.below(256), coded = random.below(gaps) == 0 ? 1 : 0;
        block.codes |= code << 8 * i;
        block.coded |= coded << 8 * i;
        if (coded != 0) said.push_back(static_cast<std::uint16_t>(272 + code));
      }
    }

    for (const GridKernels& kernels : all_grid_kernels()) {
      std::vector<std::uint16_t> out(places + 1, kUntouched);
      const std::uint16_t* end = kernels.pack(codes.data(), kinds.data(), count, out.data());
      EXPECT_EQ(out.back(), kUntouched) << kernels.name;
      out.resize(static_cast<std::size_t>(end - out.data()));
      ASSERT_EQ(out, kept) << kernels.name;

      out.assign(9 * std::size_t{blocks} + 1, kUntouched);
      end = kernels.pack_cells(cells.data(), static_cast<int>(blocks), 272, out.data());
      EXPECT_EQ(out.back(), kUntouched) << kernels.name;
      out.resize(static_cast<std::size_t>(end - out.data()));
      ASSERT_EQ(out, said) << kernels.name;
    }
  }
}

/// Cells of a line by themselves and eight at once: the same symbols in the same tables.
TEST(GridSymbols, EightCellsAreAsEachByItself) {
  test::Random random(9);
  constexpr std::array<std::uint8_t, 7> kCells{0, 1, 2, 4, 8, grid_cell::kStraight, grid_cell::kTurned};
  for (int round = 0; round < 4000; ++round) {
    std::array<std::uint8_t, 9> above{}, below{};
    std::array<std::uint8_t, 8> cells{}, good_above{};
    const std::uint32_t holes = 1 + random.below(8);
    for (auto* line : {&above, &below})
      for (std::uint8_t& there : *line) there = random.below(holes) > 0;
    for (std::uint8_t& good : good_above) good = random.below(2) > 0;
    for (std::uint8_t& cell : cells) cell = kCells[random.below(kCells.size())];
    const int count = round % 2 == 0 ? 8 : 1 + static_cast<int>(random.below(8));
    const auto asked = count == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << 8 * count) - 1;
    auto left = static_cast<std::uint8_t>(random.below(2));
    const grid::EightCells eight = grid::eight_cells(cells.data(), above.data(), below.data(), asked,
                                                     grid::load8(good_above.data()), left);
    std::uint32_t triangles = 0;
    for (int i = 0; i < 8; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const int corners = grid::kCornerCounts[grid::corners_there(above.data(), below.data(), i)];
      const bool coded = corners >= 3 && i < count;
      ASSERT_EQ(eight.coded >> 8 * i & 255, coded);
      const int symbol = coded ? grid::cell_symbol(cells[at], corners) : 1;
      ASSERT_EQ(eight.good >> 8 * i & 255, symbol == 0);
      if (coded) {
        const int table = (corners == 4 ? 4 : 0) + 2 * left + good_above[at];
        ASSERT_EQ(eight.codes >> 8 * i & 255, rans::code_of(table, symbol, grid::kControlSymbols));
        triangles += grid::triangles_of(symbol, corners);
      }
      left = symbol == 0;
    }
    ASSERT_EQ(eight.triangles, triangles);
  }
}

/// Filled cells of either diagonal, that end at any length: at a triangle that is not as it should be, at the
/// end of the line or of the triangles, at a cell that is taken.
TEST(GridKernels, RunsOfFilledCellsAgree) {
  test::Random random(8);
  for (int round = 0; round < 400; ++round) {
    const std::uint32_t length = random.below(40), upper = 3, lower = 60;
    std::vector<Triangle> triangles;
    for (std::uint32_t i = 0; i < length; ++i) {
      const std::uint32_t u = upper + i, l = lower + i;
      const bool straight = random.below(2) == 0;
      triangles.push_back(straight ? Triangle{u, l, l + 1} : Triangle{l, l + 1, u + 1});
      triangles.push_back(straight ? Triangle{l + 1, u + 1, u} : Triangle{u + 1, u, l});
    }
    if (length > 0 && random.below(2) == 0) triangles[random.below(2 * length)][random.below(3)] += 1;
    if (length > 0 && random.below(3) == 0) triangles.pop_back();
    std::vector<std::uint8_t> right(128, 1), taken(64);
    right[upper + random.below(50)] = 0;
    right[lower + 40] = 0;
    taken[random.below(64)] = grid_cell::kTurned;
    std::optional<std::pair<std::size_t, std::vector<std::uint8_t>>> reference;
    for (const GatherKernels& kernels : all_gather_kernels()) {
      std::vector<std::uint8_t> cells = taken;
      const std::size_t count = kernels.fill_run({triangles, right.data(), upper, lower, cells.data()});
      if (!reference) reference.emplace(count, cells);
      ASSERT_EQ(count, reference->first) << kernels.name << ", round " << round;
      ASSERT_EQ(cells, reference->second) << kernels.name;
    }
  }
}

}  // namespace
}  // namespace relievo
