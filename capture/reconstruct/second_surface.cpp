// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/second_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

Vec3f minus(const Vec3f& a, const Vec3f& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vec3f cross(const Vec3f& a, const Vec3f& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
float dot(const Vec3f& a, const Vec3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Whether their depth step is none, as of cells of the first places.
bool connected(const Vec3f& a, const Vec3f& b, float ratio) {
  const float extent =
      0.5F * (a[2] + b[2]) * std::hypot(a[0] / a[2] - b[0] / b[2], a[1] / a[2] - b[1] / b[2]);
  return std::fabs(a[2] - b[2]) <= ratio * extent;
}

}  // namespace

void SecondSurface::add_vertices(const std::vector<SecondPlace>& places, const SurfacePicture& picture,
                                 const Triangulator& triangulator, Surface& out) {
  for (const SecondPlace& p : places) {
    const auto position = triangulator.point(p.boundary, p.line, p.column_px);
    if (!position) continue;
    index_.line(p.line)[p.boundary] = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(*position);
    out.normals.push_back({});
    out.texture_coordinates.push_back(
        {(p.column_px + 0.5F) / static_cast<float>(picture.width_px),
         (static_cast<float>(p.line * picture.line_step_px) + 0.5F) / static_cast<float>(picture.height_px)});
    out.grid.push_back({.boundary = p.boundary,
                        .line = static_cast<std::uint16_t>(p.line + index_.lines()),
                        .column_px = p.column_px,
                        .sigma_px = p.sigma_px});
    out.sigmas_m.push_back(p.sigma_px * picture.depth_slope.metres_per_px(*position));
    out.interpolated.push_back(0);
  }
}

/// The second place, or else the first one.
std::uint32_t SecondSurface::vertex(int line, int boundary, const Surface& surface) const {
  if (const std::uint32_t second = index_.line(line)[boundary]; second != kNone) return second;
  if (boundary < 0 || line < 0) return kNone;
  const auto key = [](const GridPoint& p) { return std::uint32_t{p.line} << 16 | p.boundary; };
  const auto wanted = static_cast<std::uint32_t>(line << 16 | boundary);
  const auto end = surface.grid.begin() + first_;
  const auto found = std::ranges::lower_bound(surface.grid.begin(), end, wanted, {}, key);
  return found != end && key(*found) == wanted ? static_cast<std::uint32_t>(found - surface.grid.begin())
                                               : kNone;
}

/// The cell to the right of and below a place.
void SecondSurface::add_cell(int line, int boundary, const ColumnScale& scale, const SurfaceOptions& options,
                             Surface& out) {
  const std::array corner{vertex(line, boundary, out), vertex(line + 1, boundary, out),
                          vertex(line + 1, boundary + 1, out), vertex(line, boundary + 1, out)};
  const auto column = [&](std::size_t c) { return out.grid[corner[c]].column_px; };
  const auto position = [&](std::size_t c) -> const Vec3f& { return out.positions[corner[c]]; };
  const auto there = [&](std::size_t c) { return corner[c] != kNone; };
  // The cell's sides: from each corner to the next one.
  std::array<bool, 4> goes_on{};
  for (std::size_t c = 0; c < 4; ++c) {
    const std::size_t d = (c + 1) % 4;
    if (!there(c) || !there(d)) continue;
    const bool along = c % 2 == 0;
    const bool rises = c == 1;  // lower left to lower right; 3 to 0 runs against the boundaries
    const std::array x{kNoColumn, along || rises ? column(c) : column(d),
                       along || rises ? column(d) : column(c), kNoColumn};
    goes_on[c] = (along ? surface_goes_on_along(x, 1, scale) : surface_goes_on_across(x, 1, scale)) &&
                 connected(position(c), position(d), options.depth_step_ratio);
  }
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {  // b between the two others
    if (!there(a) || !there(b) || !there(c) || !goes_on[a] || !goes_on[b]) return;
    if (std::max({corner[a], corner[b], corner[c]}) < first_) return;  // of first places alone
    const Vec3f normal = cross(minus(position(b), position(a)), minus(position(c), position(a)));
    const float facing = -dot(normal, position(a));
    const float least = options.least_facing;
    if (!(facing > 0) ||
        facing * facing < least * least * dot(normal, normal) * dot(position(a), position(a)) ||
        !connected(position(a), position(c), options.depth_step_ratio))
      return;
    out.triangles.push_back({corner[a], corner[b], corner[c]});
    for (const std::uint32_t v : out.triangles.back())
      if (v >= first_)
        for (std::size_t axis = 0; axis < 3; ++axis) out.normals[v][axis] += normal[axis];
  };
  // With one second place the three others are a triangle already, if they are one surface.
  const auto is_second = [&](std::size_t c) { return there(c) && corner[c] >= first_; };
  const int seconds = is_second(0) + is_second(1) + is_second(2) + is_second(3);
  const bool falling = there(0) && there(2), rising = there(1) && there(3);
  const auto nearer = [&] {
    return std::fabs(position(0)[2] - position(2)[2]) <= std::fabs(position(1)[2] - position(3)[2]);
  };
  const bool straight = falling && (!rising || (seconds == 1 ? is_second(1) || is_second(3) : nearer()));
  if (straight) {
    add(0, 1, 2);
    add(2, 3, 0);
  } else if (rising) {
    add(1, 2, 3);
    add(3, 0, 1);
  }
}

/// Vertices of no triangle, of the second places. Returns how many there were.
std::size_t SecondSurface::drop_alone(Surface& out) {
  const std::size_t all = out.positions.size();
  now_.assign(all - first_, kNone);
  const auto second = std::ranges::find_if(out.triangles, [&](const Triangle& t) {
    return std::max({t[0], t[1], t[2]}) >= first_;
  });
  for (auto t = second; t != out.triangles.end(); ++t)
    for (const std::uint32_t v : *t)
      if (v >= first_) now_[v - first_] = v;
  std::uint32_t kept = first_;
  const auto move = [&](auto& values, std::size_t from) { values[kept] = values[from]; };
  for (std::size_t v = first_; v < all; ++v) {
    std::uint32_t& now = now_[v - first_];
    if (now == kNone) continue;
    move(out.positions, v);
    move(out.normals, v);
    move(out.texture_coordinates, v);
    move(out.grid, v);
    move(out.sigmas_m, v);
    const Vec3f& normal = out.normals[kept];
    const float length = std::sqrt(dot(normal, normal));
    out.normals[kept] = {normal[0] / length, normal[1] / length, normal[2] / length};
    now = kept++;
  }
  for (auto t = second; t != out.triangles.end(); ++t)
    for (std::uint32_t& v : *t)
      if (v >= first_) v = now_[v - first_];
  out.positions.resize(kept);
  out.normals.resize(kept);
  out.texture_coordinates.resize(kept);
  out.grid.resize(kept);
  out.sigmas_m.resize(kept);
  out.interpolated.resize(kept);
  return all - kept;
}

std::size_t SecondSurface::add(const std::vector<SecondPlace>& places, const DecodedGrid& first,
                               const ColumnScale& scale, const SurfaceOptions& options,
                               const Triangulator& triangulator, Surface& out) {
  if (places.empty()) return 0;
  if (index_.boundaries() != first.boundaries() || index_.lines() != first.lines())
    index_.reset(first.boundaries(), first.lines(), kNone);
  first_ = static_cast<std::uint32_t>(out.positions.size());
  add_vertices(places, *options.picture, triangulator, out);
  const auto is_second = [this](int line, int boundary) { return index_.line(line)[boundary] != kNone; };
  for (const SecondPlace& p : places) {
    if (!is_second(p.line, p.boundary)) continue;
    // The four cells around it, each with the first of its corners that is a second place.
    const int l = p.line, b = p.boundary;
    const bool left = is_second(l, b - 1), above = is_second(l - 1, b);
    if (!is_second(l - 1, b - 1) && !above && !left) add_cell(l - 1, b - 1, scale, options, out);
    if (!above && !is_second(l - 1, b + 1)) add_cell(l - 1, b, scale, options, out);
    if (!left) add_cell(l, b - 1, scale, options, out);
    add_cell(l, b, scale, options, out);
  }
  for (const SecondPlace& p : places) index_.line(p.line)[p.boundary] = kNone;
  return drop_alone(out);
}

}  // namespace relievo
