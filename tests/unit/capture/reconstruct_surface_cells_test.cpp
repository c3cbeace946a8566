// SPDX-License-Identifier: Apache-2.0
// Cells of the surface: what other sets of instructions make of them is what the portable one does, to the
// last bit. That it is right, the tests of the surface show with whichever runs here.
#include "capture/reconstruct/surface_cells.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <limits>
#include <random>
#include <string>

#include "capture/reconstruct/surface.h"
#include "tests/support/make_decoded.h"

namespace relievo {
namespace {

using test::decoded_grid;
using test::GridVertex;

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

struct Rows {
  explicit Rows(int count, std::mt19937& random) : stride(static_cast<std::size_t>(count) + 24) {
    std::uniform_real_distribution<float> off(-0.02F, 0.02F);
    std::bernoulli_distribution missing(0.2), step(0.1), linked(0.9);
    planes.assign(10 * stride, kNone);
    for (auto& row : links) {
      row.assign(stride / 8 + 2, 0);
      for (std::size_t b = 0; b < stride; ++b)
        row[b / 8] = static_cast<std::uint8_t>(row[b / 8] | (linked(random) ? 1U : 0U) << (b % 8));
    }
    for (std::size_t line = 0; line < 2; ++line) {
      for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b) {
        if (missing(random)) continue;
        float* p = planes.data() + line * 5 * stride + b;
        p[0] = 0.01F * static_cast<float>(b) + off(random) * 0.2F;
        p[stride] = 0.01F * static_cast<float>(line) + off(random) * 0.2F;
        p[2 * stride] = 1 + off(random) + (step(random) ? 0.3F : 0.F);
        p[3 * stride] = p[0] / p[2 * stride];
        p[4 * stride] = p[stride] / p[2 * stride];
      }
    }
  }
  VertexRow row(std::size_t line) const {
    const float* p = planes.data() + line * 5 * stride;
    return {p, p + stride, p + 2 * stride, p + 3 * stride, p + 4 * stride};
  }
  std::size_t stride;
  std::vector<float> planes;
  std::array<std::vector<std::uint8_t>, 4> links;
};

struct Made {
  std::vector<std::uint8_t> cells;
  std::vector<float> unit, next, views;
  CellCounts counts;
};

/// Bits of numbers, of which NaN may be any.
std::vector<std::uint32_t> bits(const std::vector<float>& values) {
  std::vector<std::uint32_t> out;
  for (const float v : values) out.push_back(v == v ? std::bit_cast<std::uint32_t>(v) : 0x7fc00000U);
  return out;
}

Made make(const CellKernels& kernels, const Rows& rows, int count) {
  Made out;
  out.cells.assign(rows.stride, 0);
  out.next.assign(3 * rows.stride, 0);
  out.views.assign(2 * rows.stride, 0);
  for (std::size_t i = 0; i < 3 * rows.stride; ++i)
    out.unit.push_back(i % 7 == 0 ? 0.F : -1e-6F * static_cast<float>(i % 5));
  const auto stride = static_cast<std::ptrdiff_t>(rows.stride);
  const VertexRow above = rows.row(0);
  const VertexRow below = rows.row(1);
  kernels.views(above.x, above.y, above.z, count, out.views.data(), out.views.data() + stride);
  kernels.make({above,
                below,
                {rows.links[0].data(), rows.links[1].data(), rows.links[2].data(), rows.links[3].data()},
                count},
               {4, 0.2F}, out.cells.data(), {out.unit.data(), stride}, {out.next.data(), stride}, out.counts);
  return out;
}

TEST(SurfaceCells, AllKernelsMakeTheSame) {
  std::mt19937 random(3);
  for (const int count : {1, 2, 7, 8, 9, 16, 89, 299, 640}) {
    for (int round = 0; round < 20; ++round) {
      const Rows rows(count, random);
      const Made reference = make(all_cell_kernels().front(), rows, count);
      for (const CellKernels& kernels : all_cell_kernels()) {
        const Made made = make(kernels, rows, count);
        ASSERT_EQ(made.cells, reference.cells) << kernels.name << ", " << count;
        ASSERT_EQ(bits(made.unit), bits(reference.unit)) << kernels.name << ", " << count;
        ASSERT_EQ(bits(made.next), bits(reference.next)) << kernels.name << ", " << count;
        ASSERT_EQ(bits(made.views), bits(reference.views)) << kernels.name << ", " << count;
        ASSERT_EQ(made.counts.step, reference.counts.step);
        ASSERT_EQ(made.counts.edge_on, reference.counts.edge_on);
      }
    }
  }
}

TEST(SurfaceCells, AllKernelsMakeTheSameOfAnything) {
  std::mt19937 random(6);
  for (int round = 0; round < 100; ++round) {
    Rows rows(97, random);
    const float extreme[] = {0, -0.F, 1e30F, -1e30F, 1e-30F, std::numeric_limits<float>::infinity(), kNone};
    for (int i = 0; i < 60; ++i) rows.planes[random() % rows.planes.size()] = extreme[random() % 7];
    const Made reference = make(all_cell_kernels().front(), rows, 97);
    for (const CellKernels& kernels : all_cell_kernels()) {
      const Made made = make(kernels, rows, 97);
      ASSERT_EQ(made.cells, reference.cells) << kernels.name;
      ASSERT_EQ(bits(made.unit), bits(reference.unit)) << kernels.name;
      ASSERT_EQ(bits(made.next), bits(reference.next)) << kernels.name;
    }
  }
}

TEST(SurfaceCells, TheSurfaceIsTheSameForAnyNumberOfThreads) {
  std::mt19937 random(4);
  std::normal_distribution<float> off(0, 0.01F);
  std::bernoulli_distribution missing(0.2);
  std::vector<GridVertex> vertices;
  for (std::uint16_t l = 0; l < 50; ++l) {
    for (std::uint16_t b = 0; b < 60; ++b) {
      if (missing(random)) continue;
      const float z = 1 + off(random);
      vertices.push_back({{.boundary = b, .line = l, .column_px = 8.F * b},
                          {0.01F * static_cast<float>(b) * z, 0.01F * static_cast<float>(l) * z, z},
                          1});
    }
  }
  const DecodedGrid decoded = decoded_grid(vertices, 60, 50);
  SurfaceScratch scratch;
  Surface serial;
  const SurfaceCounts counts = build_surface(decoded, {}, scratch, serial);
  ASSERT_GT(serial.triangles.size(), 1000U);
  ASSERT_GT(counts.step + counts.edge_on, 0U);
  for (const int threads : {1, 2, 3, 7}) {
    WorkerPool pool(threads);
    Surface made;
    const SurfaceCounts again = build_surface(decoded, {.pool = &pool}, scratch, made);
    EXPECT_EQ(made.positions, serial.positions);
    EXPECT_EQ(made.normals, serial.normals);
    EXPECT_EQ(made.triangles, serial.triangles);
    EXPECT_EQ(again.step, counts.step);
    EXPECT_EQ(again.edge_on, counts.edge_on);
    EXPECT_EQ(again.small_component, counts.small_component);
  }
}

/// Pieces of all sizes that touch in the same cells: what is dropped takes its triangles with it.
TEST(SurfaceCells, NoTriangleOfADroppedPieceStays) {
  std::mt19937 random(5);
  std::bernoulli_distribution missing(0.25), far(0.5);
  SurfaceScratch scratch;
  for (int round = 0; round < 50; ++round) {
    std::vector<GridVertex> vertices;
    for (std::uint16_t l = 0; l < 20; ++l) {
      for (std::uint16_t b = 0; b < 20; ++b) {
        if (missing(random)) continue;
        const float z = far(random) ? 1.3F : 1;
        vertices.push_back({{.boundary = b, .line = l, .column_px = 8.F * b},
                            {0.01F * static_cast<float>(b) * z, 0.01F * static_cast<float>(l) * z, z},
                            1});
      }
    }
    Surface made;
    ASSERT_GT(
        build_surface(decoded_grid(vertices, 20, 20), {.least_component = 6}, scratch, made).small_component,
        0U);
    std::vector<bool> used(made.positions.size());
    for (const Triangle& t : made.triangles) {
      for (const std::uint32_t v : t) {
        ASSERT_LT(v, made.positions.size());
        used[v] = true;
        ASSERT_EQ(made.positions[v][2], made.positions[t[0]][2]) << "a triangle bridges the step";
      }
    }
    for (const bool u : used) ASSERT_TRUE(u) << "a vertex of a piece of six is in no triangle";
  }
}

}  // namespace
}  // namespace relievo
