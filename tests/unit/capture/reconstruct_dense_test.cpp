// SPDX-License-Identifier: Apache-2.0
// The dense surface, holes and depth steps: on exact geometry, and on simulated takes with their truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <vector>

#include "capture/reconstruct/depth_sigma.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/surface_builder.h"
#include "capture/source/sim/sim_source.h"
#include "tests/support/striped_scene.h"

namespace relievo {
namespace {

using test::striped_scene;
using test::StripedScene;

constexpr int kLines = 60;

/// Exact boundaries of planes: `plane(line)` is what a line shows, in `from` <= column < `to`.
struct Stretch {
  StripedScene scene;
  double from = 0;
  double to = 1e9;
};
void place(const std::vector<Stretch>& stretches, const Triangulator& triangulator,
           const std::function<bool(int boundary, int line)>& there, DecodedGrid& grid) {
  for (int line = 0; line < kLines; ++line) {
    for (const Stretch& s : stretches) {
      for (int b = 0; b < s.scene.pattern.boundaries(); ++b) {
        const double column = s.scene.camera_column(b);
        if (column < std::max(1.0, s.from) || column >= std::min(158.0, s.to) || !there(b, line)) continue;
        grid.put(line, b, static_cast<float>(column), 0.05F, 10);
      }
    }
    triangulator.place_line(line, grid);
  }
}
DecodedGrid blank(const StripedScene& scene) {
  DecodedGrid out;
  out.reset(scene.pattern.boundaries(), kLines);
  return out;
}
bool everywhere(int, int) {
  return true;
}

struct Built {
  Surface surface;
  FilterCounts counts;
};
Built build(const std::vector<Stretch>& stretches, const SurfaceBuilderOptions& options,
            const std::function<bool(int, int)>& there = everywhere, int threads = 1) {
  const StripedScene& scene = stretches[0].scene;
  const Triangulator triangulator(scene.rig, scene.pattern, kLines, 2);
  SurfaceBuilder builder(scene.rig, 2, options);
  WorkerPool pool(threads);
  Built out;
  DecodedGrid grid = blank(scene);
  place(stretches, triangulator, there, grid);
  builder.build(grid, {}, triangulator, pool, out.surface, out.counts);
  return out;
}

double off_plane_m(const StripedScene& scene, const Vec3f& p) {
  return std::fabs(p[2] - (scene.depth_m + scene.slope * p[0]));
}

TEST(Dense, EveryPixelBetweenBoundariesLiesOnThePlane) {
  const StripedScene scene = striped_scene();
  const Built dense = build({{scene}}, {.dense = true});
  const Built sparse = build({{scene}}, {});
  const Surface& s = dense.surface;
  ASSERT_GT(s.positions.size(), 6 * sparse.surface.positions.size());
  ASSERT_EQ(s.grid.size(), s.positions.size());
  ASSERT_EQ(s.sigmas_m.size(), s.positions.size());
  ASSERT_EQ(s.interpolated.size(), s.positions.size());
  std::size_t interpolated = 0;
  for (std::size_t i = 0; i < s.positions.size(); ++i) {
    const GridPoint& at = s.grid[i];
    EXPECT_EQ(at.column_px, std::floor(at.column_px));
    // A pixel is 25 mm here: a fiftieth of one.
    ASSERT_LT(off_plane_m(scene, s.positions[i]), 0.0005) << at.column_px;
    double nearest = 1e9;
    for (int b = 0; b < scene.pattern.boundaries(); ++b)
      nearest = std::min(nearest, std::fabs(scene.camera_column(b) - static_cast<double>(at.column_px)));
    const bool tie = std::fabs(nearest - 0.5) < 1e-4;
    EXPECT_TRUE(tie || (s.interpolated[i] != 0) == (nearest > 0.5)) << at.column_px;
    EXPECT_EQ(at.interpolated, s.interpolated[i] != 0);
    interpolated += s.interpolated[i];
  }
  EXPECT_EQ(dense.counts.interpolated, interpolated);
  EXPECT_EQ(std::count(sparse.surface.interpolated.begin(), sparse.surface.interpolated.end(), 1), 0);
}

// Of a filled boundary no standard deviation is known, so none is of what lies between it and the next one.
TEST(Dense, BesideAFilledBoundaryNoErrorIsKnown) {
  const auto there = [](int boundary, int line) { return boundary != 7 || line % 2 != 0; };
  const Built b = build({{striped_scene()}}, {.dense = true, .fill_holes = 2}, there);
  ASSERT_GT(b.counts.filled, 0U);
  std::size_t unknown_left = 0;
  std::size_t unknown_right = 0;
  for (const GridPoint& at : b.surface.grid) {
    if (at.sigma_px > 0) {
      EXPECT_GT(at.sigma_px, 0.03) << at.column_px;  // of two that are each known to 0.05
    } else {
      EXPECT_EQ(at.line % 2, 0) << at.column_px;
      ++(at.boundary < 7 ? unknown_left : unknown_right);
    }
  }
  EXPECT_GT(unknown_left, 0U);
  EXPECT_GT(unknown_right, 0U);
}

TEST(Dense, ThreadsDoNotChangeIt) {
  const StripedScene scene = striped_scene();
  const Built one = build({{scene}}, {.dense = true});
  const Built three = build({{scene}}, {.dense = true}, everywhere, 3);
  EXPECT_EQ(one.surface.positions, three.surface.positions);
  EXPECT_EQ(one.surface.triangles, three.surface.triangles);
  EXPECT_EQ(one.counts, three.counts);
}

/// A near plane to the left, a far one to the right.
std::vector<Stretch> step_across(const StripedScene& scene) {
  StripedScene far = scene;
  far.depth_m = 1.3;
  return {{scene, 0, 80}, {far, 80, 1e9}};
}

std::size_t spanning(const Surface& s, double depth_m) {
  std::size_t n = 0;
  for (const Triangle& t : s.triangles) {
    float low = std::numeric_limits<float>::max();
    float high = 0;
    for (const std::uint32_t v : t) {
      low = std::min(low, s.positions[v][2]);
      high = std::max(high, s.positions[v][2]);
    }
    n += high - low > depth_m;
  }
  return n;
}

TEST(Steps, NoTriangleBridgesOneAcrossTheLines) {
  StripedScene scene = striped_scene();
  scene.slope = 0;
  for (const bool dense : {false, true}) {
    const Built b = build(step_across(scene), {.dense = dense});
    EXPECT_GT(b.surface.triangles.size(), 100U);
    EXPECT_EQ(spanning(b.surface, 0.1), 0U) << dense;
    for (const Vec3f& p : b.surface.positions)
      EXPECT_LT(std::min(std::fabs(p[2] - 1), std::fabs(p[2] - 1.3F)), 0.002F) << dense;
  }
}

TEST(Steps, NoTriangleBridgesOneBetweenTwoLines) {
  // Each boundary jumps along its own light sheet: 0.3 m of depth for 0.06 m across, which a limit on the
  // ratio of the two would take for a slanted surface.
  StripedScene near = striped_scene();
  near.slope = 0;
  StripedScene far = near;
  far.depth_m = 1.3;
  const Triangulator triangulator(near.rig, near.pattern, kLines, 2);
  DecodedGrid grid = blank(near);
  place(
      {{near}}, triangulator, [](int, int line) { return line < 30; }, grid);
  place(
      {{far}}, triangulator, [](int, int line) { return line >= 30; }, grid);
  SurfaceBuilder builder(near.rig, 2, {});
  WorkerPool pool(1);
  Surface s;
  FilterCounts counts;
  builder.build(grid, {}, triangulator, pool, s, counts);
  EXPECT_GT(s.triangles.size(), 100U);
  EXPECT_EQ(spanning(s, 0.1), 0U);
  EXPECT_GT(counts.step, 0U);
}

/// Whether truth jumps by more than `step` of depth somewhere between two vertices, and they follow the jump.
bool bridges(const ImageF& truth, const Surface& s, std::uint32_t a, std::uint32_t b, float step) {
  constexpr int kSamples = 24;
  const auto pixel = [&](std::uint32_t v, int axis) {
    const int size = axis == 0 ? truth.width() : truth.height();
    return s.texture_coordinates[v][static_cast<std::size_t>(axis)] * static_cast<float>(size) - 0.5F;
  };
  float before = 0;
  for (int i = 0; i <= kSamples; ++i) {
    const float t = static_cast<float>(i) / kSamples;
    const auto at = [&](int axis) {
      const long most = (axis == 0 ? truth.width() : truth.height()) - 1;
      return static_cast<int>(
          std::clamp(std::lround(pixel(a, axis) + t * (pixel(b, axis) - pixel(a, axis))), 0L, most));
    };
    const float z = truth.row(at(1))[at(0)];
    const float jump = std::fabs(z - before);
    if (before > 0 && z > 0 && jump > step * z &&
        std::fabs(s.positions[a][2] - s.positions[b][2]) > 0.5F * jump)
      return true;
    before = z;
  }
  return false;
}

TEST(Steps, NoTriangleBridgesOneOfASimulatedScene) {
  for (const bool dense : {false, true}) {
    auto source = make_sim("object", {.truth = true});
    ASSERT_TRUE(source) << source.error().message;
    auto reconstructor = Reconstructor::create((*source)->info().rig, (*source)->info().pattern,
                                               {.texture = false, .surface = {.dense = dense}});
    ASSERT_TRUE(reconstructor) << reconstructor.error().message;
    std::size_t triangles = 0;
    std::size_t bridging = 0;
    for (int n = 0; n < 3; ++n) {
      auto next = (*source)->next();
      ASSERT_TRUE(next && *next);
      auto frame = reconstructor->add(**next);
      ASSERT_TRUE(frame) << frame.error().message;
      if (!*frame) continue;
      const Surface& s = (*frame)->surface;
      const ImageF& truth = (*source)->truth();
      triangles += s.triangles.size();
      for (const Triangle& t : s.triangles)
        bridging += bridges(truth, s, t[0], t[1], 0.02F) || bridges(truth, s, t[1], t[2], 0.02F) ||
                    bridges(truth, s, t[2], t[0], 0.02F);
    }
    EXPECT_GT(triangles, 20000U);
    EXPECT_EQ(bridging, 0U) << (dense ? "dense" : "at boundaries");
  }
}

TEST(Steps, ACreaseIsNone) {
  const StripedScene left = striped_scene();
  StripedScene right = left;
  right.slope = -0.3;  // the two planes meet at x = 0, column 79.5
  const std::vector<Stretch> roof{{left, 0, 79.5}, {right, 79.5, 1e9}};
  const Built b = build(roof, {});
  EXPECT_EQ(b.counts.step, 0U);
  EXPECT_EQ(b.counts.edge_on, 0U);
}

TEST(Holes, AreFilledUpToTheSizeAskedForAndMarked) {
  const StripedScene scene = striped_scene();
  const auto hole = [](int boundary, int line) {
    return !(boundary >= 5 && boundary <= 7 && line >= 20 && line <= 40);
  };
  const Built full = build({{scene}}, {});
  const Built open = build({{scene}}, {}, hole);
  const Built two = build({{scene}}, {.fill_holes = 2}, hole);
  const Built three = build({{scene}}, {.fill_holes = 3}, hole);
  EXPECT_EQ(open.counts.filled, 0U);
  EXPECT_EQ(two.counts.filled, 0U);
  EXPECT_EQ(three.counts.filled, 3U * 21U);
  EXPECT_EQ(three.surface.positions.size(), full.surface.positions.size());
  EXPECT_EQ(three.surface.triangles.size(), full.surface.triangles.size());
  std::size_t marked = 0;
  for (std::size_t i = 0; i < three.surface.positions.size(); ++i) {
    const GridPoint& at = three.surface.grid[i];
    EXPECT_EQ(three.surface.interpolated[i] != 0, !hole(at.boundary, at.line));
    marked += three.surface.interpolated[i];
    ASSERT_LT(off_plane_m(scene, three.surface.positions[i]), 0.01);
  }
  EXPECT_EQ(marked, three.counts.filled);
}

TEST(Holes, AtADepthStepStayOpen) {
  StripedScene scene = striped_scene();
  scene.slope = 0;
  const auto stretches = step_across(scene);
  const Built open = build(stretches, {});
  const Built filled = build(stretches, {.fill_holes = 6});
  for (const Vec3f& p : filled.surface.positions)
    EXPECT_LT(std::min(std::fabs(p[2] - 1), std::fabs(p[2] - 1.3F)), 0.002F);
  EXPECT_EQ(filled.surface.positions.size(), open.surface.positions.size());
}

TEST(DepthSigma, IsTheSlopeOfDepthTimesTheColumns) {
  const StripedScene scene = striped_scene();
  const Triangulator triangulator(scene.rig, scene.pattern, kLines, 2);
  const Surface s = build({{scene}}, {}).surface;
  ASSERT_FALSE(s.positions.empty());
  for (std::size_t i = 0; i < s.positions.size(); ++i) {
    const GridPoint& at = s.grid[i];
    const auto left = triangulator.point(at.boundary, at.line, at.column_px - 0.1F);
    const auto right = triangulator.point(at.boundary, at.line, at.column_px + 0.1F);
    ASSERT_TRUE(left && right);
    const float wanted = 0.05F * std::fabs((*right)[2] - (*left)[2]) / 0.2F;
    ASSERT_NEAR(s.sigmas_m[i], wanted, 0.02F * wanted);
  }
}

TEST(DepthSigma, OfManyAtOnceIsThatOfEach) {
  const StripedScene scene = striped_scene();
  const DepthSlope slope(scene.rig);
  std::mt19937 random(5);
  std::normal_distribution<float> off(0, 1);
  for (const int count : {1, 7, 8, 9, 299}) {
    std::vector<std::vector<float>> rows(4);
    for (auto& row : rows) row.assign(static_cast<std::size_t>(count) + 8, 1);
    for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b) {
      for (auto& row : rows) row[b] = random() % 20 == 0 ? 0.F : off(random);
      if (random() % 10 == 0) rows[random() % 3][b] = 1e20F;
    }
    std::vector<float> out(static_cast<std::size_t>(count) + 8);
    const DepthSlope::Positions at{rows[0].data(), rows[1].data(), rows[2].data()};
    slope.sigmas_m(at, rows[3].data(), count, out.data());
    for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b) {
      const float wanted = rows[3][b] > 0 ? rows[3][b] * slope.metres_per_px({at.x[b], at.y[b], at.z[b]}) : 0;
      EXPECT_TRUE(out[b] == wanted || (std::isnan(out[b]) && std::isnan(wanted))) << out[b] << ", " << wanted;
    }
    const DepthSlopeRig rig{{0.9F, 0.1F, 0, -0.1F, 1, 0, 0.2F, 0, 0.8F}, {0.1F, 0, -0.05F}, 0.002F};
    std::vector<float> reference(out.size());
    all_depth_sigma_kernels().front().sigmas_m(rig, at, rows[3].data(), count, reference.data());
    for (const DepthSigmaKernels& kernels : all_depth_sigma_kernels()) {
      kernels.sigmas_m(rig, at, rows[3].data(), count, out.data());
      for (std::size_t b = 0; b < static_cast<std::size_t>(count); ++b)
        EXPECT_TRUE(out[b] == reference[b] || (std::isnan(out[b]) && std::isnan(reference[b])))
            << kernels.name;
    }
  }
}

/// Standard scores of depth errors against a simulated take's truth, away from steps.
TEST(DepthSigma, IsWhatDepthErrorsAre) {
  auto source = make_sim("object,noise=2", {.truth = true});
  ASSERT_TRUE(source) << source.error().message;
  const SourceInfo& info = (*source)->info();
  auto reconstructor = Reconstructor::create(info.rig, info.pattern, {.texture = false});
  ASSERT_TRUE(reconstructor) << reconstructor.error().message;
  std::vector<double> scores;
  for (int n = 0; n < 4; ++n) {
    auto next = (*source)->next();
    ASSERT_TRUE(next && *next);
    auto frame = reconstructor->add(**next);
    ASSERT_TRUE(frame) << frame.error().message;
    if (!*frame) continue;
    const ImageF& truth = (*source)->truth();
    ASSERT_FALSE(truth.empty());
    const Surface& s = (*frame)->surface;
    for (std::size_t i = 0; i < s.positions.size(); ++i) {
      const int row = s.grid[i].line * 2 % truth.height();  // of second places, too
      const float column = s.grid[i].column_px;
      const int x = static_cast<int>(column);
      if (x < 8 || x + 9 >= truth.width()) continue;
      const float a = truth.row(row)[x];
      const float b = truth.row(row)[x + 1];
      if (!(a > 0 && b > 0) || std::fabs(a - b) > 0.01F * a) continue;
      const float z = a + (column - static_cast<float>(x)) * (b - a);
      ASSERT_GT(s.sigmas_m[i], 0);
      scores.push_back(std::fabs(s.positions[i][2] - z) / s.sigmas_m[i]);
    }
  }
  ASSERT_GT(scores.size(), 10000U);
  std::nth_element(scores.begin(), scores.begin() + static_cast<std::ptrdiff_t>(scores.size() / 2),
                   scores.end());
  const double sigmas = scores[scores.size() / 2] / 0.6745;  // robust standard deviation; 1 would be perfect
  EXPECT_GT(sigmas, 0.3);
  EXPECT_LT(sigmas, 2);
}

}  // namespace
}  // namespace relievo
