// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface.h"

#include <array>
#include <cmath>
#include <numeric>

namespace relievo {
namespace {

Vec3f minus(const Vec3f& a, const Vec3f& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

Vec3f cross(const Vec3f& a, const Vec3f& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

float dot(const Vec3f& a, const Vec3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Makes scratch.parent each vertex's root and scratch.size each root's count of vertices.
void find_components(std::size_t vertices, const std::vector<Triangle>& triangles, SurfaceScratch& scratch) {
  auto& parent = scratch.parent;
  parent.resize(vertices);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root_of = [&](std::uint32_t v) {
    auto root = static_cast<std::int32_t>(v);
    while (parent[static_cast<std::size_t>(root)] != root) {
      auto& up = parent[static_cast<std::size_t>(root)];
      up = parent[static_cast<std::size_t>(up)];  // halves the path
      root = up;
    }
    return root;
  };
  for (const std::vector<Triangle>* list :
       {&triangles, static_cast<const std::vector<Triangle>*>(&scratch.cut)}) {
    for (const Triangle& t : *list) {
      const std::int32_t first = root_of(t[0]);
      for (const std::uint32_t v : {t[1], t[2]}) parent[static_cast<std::size_t>(root_of(v))] = first;
    }
  }
  scratch.size.assign(vertices, 0);
  for (std::size_t v = 0; v < vertices; ++v) {
    parent[v] = root_of(static_cast<std::uint32_t>(v));
    ++scratch.size[static_cast<std::size_t>(parent[v])];
  }
}

/// No depth step between two neighbours on the grid.
bool connected(const Vec3f& a, const Vec3f& b, float ratio) {
  const float depth = std::fabs(a[2] - b[2]);
  // Extent across the view: the part of a - b that is at right angles to the ray through their middle.
  const float z = 0.5F * (a[2] + b[2]);
  const float dx = (a[0] / a[2] - b[0] / b[2]) * z;
  const float dy = (a[1] / a[2] - b[1] / b[2]) * z;
  return depth * depth <= ratio * ratio * (dx * dx + dy * dy);
}

}  // namespace

SurfaceCounts build_surface(const std::vector<GridVertex>& vertices, int boundaries, int lines,
                            const SurfaceOptions& options, SurfaceScratch& scratch, Surface& out) {
  SurfaceCounts counts;
  const auto cell = [&](int line, int boundary) {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries) +
           static_cast<std::size_t>(boundary);
  };
  auto& grid = scratch.grid;
  grid.assign(static_cast<std::size_t>(boundaries) * static_cast<std::size_t>(lines), -1);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const GridPoint& at = vertices[i].at;
    std::int32_t& slot = grid[cell(at.line, options.by_pixel ? static_cast<int>(at.column_px) : at.boundary)];
    counts.duplicate += slot >= 0;
    if (slot < 0 || better(vertices[i], vertices[static_cast<std::size_t>(slot)]))
      slot = static_cast<std::int32_t>(i);
  }

  // Cells between boundaries b, b + 1 and lines l, l + 1. Corners run counter-clockwise as the camera sees
  // them (x right, y down): upper left, lower left, lower right, upper right. The image runs left to right
  // with rising boundary number, as the projector's columns do.
  out.triangles.clear();
  const auto position = [&](std::int32_t i) -> const Vec3f& {
    return vertices[static_cast<std::size_t>(i)].position;
  };
  scratch.cut.clear();
  const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c, bool linked) {
    const float r = options.depth_step_ratio;
    if (!connected(position(a), position(b), r) || !connected(position(b), position(c), r) ||
        !connected(position(c), position(a), r)) {
      ++counts.step;
      return;
    }
    // Order may be reversed where the surface is seen through a fold; the normal must face the camera.
    const Vec3f n = cross(minus(position(b), position(a)), minus(position(c), position(a)));
    const Vec3f& p = position(a);
    const float facing = -dot(n, p);
    const float least = options.least_facing;
    if (!(facing > 0) || facing * facing < least * least * dot(n, n) * dot(p, p)) {
      ++counts.edge_on;
      return;
    }
    counts.step += !linked;
    (linked ? out.triangles : scratch.cut)
        .push_back(
            {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(c)});
  };
  for (int line = 0; line + 1 < lines; ++line) {
    for (int b = 0; b + 1 < boundaries; ++b) {
      const std::array<std::int32_t, 4> q{grid[cell(line, b)], grid[cell(line + 1, b)],
                                          grid[cell(line + 1, b + 1)], grid[cell(line, b + 1)]};
      const int present = (q[0] >= 0) + (q[1] >= 0) + (q[2] >= 0) + (q[3] >= 0);
      if (present < 3) continue;
      // Sides from each corner to the next; a triangle has the two that do not touch the corner it leaves
      // out.
      std::array<bool, 4> on{true, true, true, true};
      if (const GridLinks* links = options.links) {
        on = {links->along[cell(line, b)] != 0, links->across[cell(line + 1, b)] != 0,
              links->along[cell(line, b + 1)] != 0, links->across[cell(line, b)] != 0};
      }
      const auto add_without = [&](std::size_t corner) {
        const std::size_t i = (corner + 1) % 4;
        const std::size_t j = (corner + 2) % 4;
        add(q[i], q[j], q[(corner + 3) % 4], on[i] && on[j]);
      };
      if (present == 3) {
        add_without(q[0] < 0 ? 0 : q[1] < 0 ? 1 : q[2] < 0 ? 2 : 3);
        continue;
      }
      // The diagonal with the smaller depth step follows the surface.
      if (std::fabs(position(q[0])[2] - position(q[2])[2]) <=
          std::fabs(position(q[1])[2] - position(q[3])[2])) {
        add_without(3);
        add_without(1);
      } else {
        add_without(2);
        add_without(0);
      }
    }
  }

  find_components(vertices.size(), out.triangles, scratch);
  const auto in_small_component = [&](std::size_t v) {
    const auto root = static_cast<std::size_t>(scratch.parent[v]);
    return scratch.size[root] < options.least_component;
  };
  std::erase_if(out.triangles, [&](const Triangle& t) { return in_small_component(t[0]); });

  // Vertices in grid order, so that output does not depend on the order of detection.
  auto& kept = scratch.kept;
  kept.assign(vertices.size(), -1);
  out.positions.clear();
  out.normals.clear();
  out.grid.clear();
  for (const std::int32_t slot : grid) {
    if (slot < 0) continue;
    if (in_small_component(static_cast<std::size_t>(slot))) {
      ++counts.small_component;
      continue;
    }
    kept[static_cast<std::size_t>(slot)] = static_cast<std::int32_t>(out.positions.size());
    out.positions.push_back(position(slot));
    out.grid.push_back(vertices[static_cast<std::size_t>(slot)].at);
  }
  out.normals.assign(out.positions.size(), Vec3f{});
  for (Triangle& t : out.triangles) {
    for (std::uint32_t& v : t) v = static_cast<std::uint32_t>(kept[v]);
    // The cross product's length weighs each triangle by its area.
    const Vec3f n = cross(minus(out.positions[t[1]], out.positions[t[0]]),
                          minus(out.positions[t[2]], out.positions[t[0]]));
    for (const std::uint32_t v : t) {
      for (std::size_t c = 0; c < 3; ++c) out.normals[v][c] += n[c];
    }
  }
  for (Vec3f& n : out.normals) {
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    n = length > 0 ? Vec3f{n[0] / length, n[1] / length, n[2] / length} : Vec3f{0, 0, -1};
  }
  return counts;
}

}  // namespace relievo
