// SPDX-License-Identifier: Apache-2.0
// Surfaces on the grid of stripes and lines, as a reconstruction makes them, with rig and pattern: two waves
// at different depths, a step between them, holes and noise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/triangulate.h"
#include "tests/support/make_surface.h"

namespace relievo::test {

struct GridScene {
  int width = 640;
  int height = 480;
  int stripes = 40;
  bool distorts = false;   // lenses
  float noise_px = 0.05F;  // uniform, on both sides
  float shift_px = 0;      // of the nearer surface, for motion
  std::uint64_t seed = 1;
  bool quality = false;  // sigmas and some interpolated vertices
};

inline Rig grid_rig(const GridScene& scene) {
  Rig rig;
  rig.frame_rate = 30;
  const double scale = scene.width / 640.0;
  rig.camera = {
      scene.width, scene.height, {820 * scale, 0, 318 * scale, 0, 815 * scale, 241 * scale, 0, 0, 1}, {}};
  rig.projector = {1024, 768, {1180, 0, 510, 0, 1175, 390, 0, 0, 1}, {}};
  if (scene.distorts) {
    rig.camera.distortion = {-0.11, 0.06, 0.0004, -0.0006, -0.01};
    rig.projector.distortion = {-0.025, 0.04, -0.0005, 0.0003, 0.005};
  }
  const double c = std::cos(0.2);
  const double s = std::sin(0.2);
  rig.projector_from_camera_rotation = {c, 0, -s, 0, 1, 0, s, 0, c};
  rig.projector_from_camera_translation = {0.2, 0.004, 0.03};
  return rig;
}

inline Pattern grid_pattern(const GridScene& scene) {
  Pattern pattern;
  pattern.sequence.assign(static_cast<std::size_t>(scene.stripes), 0);  // codes do not matter here
  return pattern;
}

/// From the middle of the nearer surface, which ends at kNearRadius; shares of the grid's sides.
inline float from_near_middle(float u, float v) {
  return std::hypot(u - 0.62F, v - 0.45F);
}
constexpr float kNearRadius = 0.22F;

/// How far the nearer surface's columns lie from those of the one behind.
inline float near_offset_px(const GridScene& scene) {
  const float pitch = 0.8F * static_cast<float>(scene.width) / static_cast<float>(scene.stripes);
  return 1.4F * pitch + scene.shift_px;
}

/// triangle(i, j, k) of a cell's two, on the diagonal from corner 0 to 2 or else from 1 to 3.
template <typename Add>
void split_cell(bool straight, const Add& triangle) {
  if (straight) {
    triangle(0, 1, 2);
    triangle(2, 3, 0);
  } else {
    triangle(1, 2, 3);
    triangle(3, 0, 1);
  }
}

/// Triangulated by the reconstruction's own Triangulator.
inline Frame3D grid_frame(const GridScene& scene) {
  const Rig rig = grid_rig(scene);
  const Pattern pattern = grid_pattern(scene);
  const int lines = scene.height / 2;
  const Triangulator triangulator(rig, pattern, lines, 2);
  Random random(scene.seed);
  Frame3D frame;
  frame.number = scene.seed;
  frame.time_ns = 1'700'000'000'000'000'000;
  Surface& out = frame.surface;
  const int boundaries = pattern.boundaries();
  std::vector<std::int32_t> index(static_cast<std::size_t>(lines) * static_cast<std::size_t>(boundaries), -1);
  std::vector<std::uint8_t> near(index.size());
  const auto at = [&](int line, int b) { return static_cast<std::size_t>(line * boundaries + b); };
  const float pitch = 0.8F * static_cast<float>(scene.width) / static_cast<float>(scene.stripes);
  for (int line = 0; line < lines; ++line) {
    for (int b = 0; b < boundaries; ++b) {
      const float v = static_cast<float>(line) / static_cast<float>(lines);
      const float u = static_cast<float>(b) / static_cast<float>(boundaries);
      const float noise = scene.noise_px * 2 * (random.unit() - 0.5F);
      const bool hole = std::hypot(u - 0.3F, v - 0.6F) < 0.08F || random.below(400) == 0;
      if (hole || v < 0.05F + 0.05F * std::sin(9 * u) || u + 0.1F * std::sin(6 * v) > 0.93F) continue;
      const bool is_near = from_near_middle(u, v) < kNearRadius;
      float column = 0.12F * static_cast<float>(scene.width) +
                     pitch * (static_cast<float>(b) + 1.5F * std::sin(5 * u + 3 * v)) + noise;
      if (is_near) column += near_offset_px(scene);
      const auto position = triangulator.point(b, line, column);
      if (!position) continue;
      index[at(line, b)] = static_cast<std::int32_t>(out.positions.size());
      near[at(line, b)] = is_near;
      out.positions.push_back(*position);
      out.grid.push_back({static_cast<std::uint16_t>(b), static_cast<std::uint16_t>(line), column});
      out.texture_coordinates.push_back(
          {(column + 0.5F) / static_cast<float>(scene.width),
           (static_cast<float>(2 * line) + 0.5F) / static_cast<float>(scene.height)});
      if (!scene.quality) continue;
      GridPoint& place = out.grid.back();
      place.sigma_px = random.below(20) == 0 ? 0 : 0.02F + 0.1F * u + 0.01F * random.unit();
      place.interpolated = hole || random.below(30) == 0;
      out.sigmas_m.push_back(place.sigma_px * 0.002F);
      out.interpolated.push_back(place.interpolated);
    }
  }
  for (int line = 0; line + 1 < lines; ++line) {
    for (int b = 0; b + 1 < boundaries; ++b) {
      const std::size_t q[4] = {at(line, b), at(line + 1, b), at(line + 1, b + 1), at(line, b + 1)};
      const auto triangle = [&](int i, int j, int k) {
        for (const int c : {i, j, k})
          if (index[q[c]] < 0 || near[q[c]] != near[q[i]]) return;
        out.triangles.push_back({static_cast<std::uint32_t>(index[q[i]]),
                                 static_cast<std::uint32_t>(index[q[j]]),
                                 static_cast<std::uint32_t>(index[q[k]])});
      };
      split_cell(index[q[0]] >= 0 && index[q[2]] >= 0 && near[q[0]] == near[q[2]], triangle);
    }
  }
  return frame;
}

/// The same where what lies behind is seen past the rim of the nearer surface, a little way: second places,
/// which go on from its first ones.
inline Frame3D twice_frame(const GridScene& scene) {
  Frame3D frame = grid_frame(scene);
  Surface& out = frame.surface;
  const Pattern pattern = grid_pattern(scene);
  const int lines = scene.height / 2, boundaries = pattern.boundaries();
  const Triangulator triangulator(grid_rig(scene), pattern, lines, 2);
  const auto at = [&](int line, int b) { return static_cast<std::size_t>(line * boundaries + b); };
  // Of the surface behind: its vertices, first places or second ones.
  std::vector<std::int32_t> behind(at(lines, 0), -1);
  const std::size_t firsts = out.grid.size();
  for (std::size_t i = 0; i < firsts; ++i) {
    GridPoint p = out.grid[i];
    const int line = p.line, b = p.boundary;
    const float middle = from_near_middle(static_cast<float>(b) / static_cast<float>(boundaries),
                                          static_cast<float>(line) / static_cast<float>(lines));
    if (middle >= kNearRadius) behind[at(line, b)] = static_cast<std::int32_t>(i);
    if (middle >= kNearRadius || middle < kNearRadius - 0.05F) continue;
    p.column_px -= near_offset_px(scene);
    const auto position = triangulator.point(b, line, p.column_px);
    if (!position) continue;
    behind[at(line, b)] = static_cast<std::int32_t>(out.grid.size());
    p.line = static_cast<std::uint16_t>(line + lines);
    out.grid.push_back(p);
    out.positions.push_back(*position);
    out.texture_coordinates.push_back(
        {(p.column_px + 0.5F) / static_cast<float>(scene.width), out.texture_coordinates[i][1]});
    if (!scene.quality) continue;
    out.sigmas_m.push_back(p.sigma_px * 0.002F);
    out.interpolated.push_back(p.interpolated);
  }
  for (int line = 0; line + 1 < lines; ++line) {
    for (int b = 0; b + 1 < boundaries; ++b) {
      const std::int32_t q[4] = {behind[at(line, b)], behind[at(line + 1, b)], behind[at(line + 1, b + 1)],
                                 behind[at(line, b + 1)]};
      const auto triangle = [&](int i, int j, int k) {
        if (q[i] < 0 || q[j] < 0 || q[k] < 0) return;
        const Triangle t = {static_cast<std::uint32_t>(q[i]), static_cast<std::uint32_t>(q[j]),
                            static_cast<std::uint32_t>(q[k])};
        if (t[0] >= firsts || t[1] >= firsts || t[2] >= firsts) out.triangles.push_back(t);
      };
      const auto is_second = [&](std::int32_t v) { return v >= static_cast<std::int32_t>(firsts); };
      if (std::count_if(q, q + 4, is_second) == 1 && std::count(q, q + 4, -1) == 0) {
        // The first places have the triangle of the other three.
        const int c = static_cast<int>(std::find_if(q, q + 4, is_second) - q);
        triangle((c + 3) % 4, c, (c + 1) % 4);
      } else {
        split_cell(q[0] >= 0 && q[2] >= 0, triangle);
      }
    }
  }
  return frame;
}

/// Takes the vertices of which `gone` says so out of a frame, and the triangles on them.
template <typename Gone>
void drop_vertices(Frame3D& frame, const Gone& gone) {
  Surface& s = frame.surface;
  std::vector<std::uint32_t> now(s.grid.size());
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < now.size(); ++i) now[i] = gone(s.grid[i]) ? ~0U : kept++;
  const auto keep = [&](auto& values) {
    if (values.empty()) return;
    for (std::size_t i = 0; i < now.size(); ++i)
      if (now[i] != ~0U) values[now[i]] = values[i];
    values.resize(kept);
  };
  keep(s.positions);
  keep(s.normals);
  keep(s.texture_coordinates);
  keep(s.grid);
  keep(s.sigmas_m);
  keep(s.interpolated);
  std::vector<Triangle> triangles;
  for (const Triangle& t : s.triangles) {
    const Triangle moved = {now[t[0]], now[t[1]], now[t[2]]};
    if (moved[0] != ~0U && moved[1] != ~0U && moved[2] != ~0U) triangles.push_back(moved);
  }
  s.triangles = std::move(triangles);
}

/// Eight places in a row are never as those around them, where those are all there.
inline Frame3D never_alike_frame(const GridScene& scene) {
  Frame3D frame = grid_frame(scene);
  drop_vertices(frame, [](const GridPoint& p) { return p.line % 2 == 1 && p.boundary % 8 == 4; });
  return frame;
}

}  // namespace relievo::test
