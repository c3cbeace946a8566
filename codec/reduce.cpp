// SPDX-License-Identifier: Apache-2.0
#include "codec/reduce.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "base/fit_image.h"

namespace relievo {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Vertices and triangles by their place.
struct Places {
  std::size_t stride = 0;
  std::vector<std::uint32_t> vertex;    // kNone: there is none
  std::vector<std::uint8_t> triangles;  // of the cell below and right: bits as in grid_cell

  std::size_t at(std::size_t line, std::size_t boundary) const { return line * stride + boundary; }
};

bool find_vertices(const Surface& surface, int picture_lines, Places& out) {
  std::size_t boundaries = 0, lines = 0;
  for (const GridPoint& p : surface.grid) {
    if (p.line >= picture_lines) continue;
    boundaries = std::max<std::size_t>(boundaries, p.boundary + 1U);
    lines = std::max<std::size_t>(lines, p.line + 1U);
  }
  out.stride = boundaries + 1;
  out.vertex.assign((lines + 2) * out.stride, kNone);
  out.triangles.assign(out.vertex.size(), 0);
  for (std::size_t i = 0; i < surface.grid.size(); ++i) {
    if (surface.grid[i].line >= picture_lines) continue;
    std::uint32_t& place = out.vertex[out.at(surface.grid[i].line, surface.grid[i].boundary)];
    if (place != kNone) return false;  // of a dense surface, say
    place = static_cast<std::uint32_t>(i);
  }
  return true;
}

bool find_triangles(const Surface& surface, int picture_lines, Places& out) {
  for (const Triangle& triangle : surface.triangles) {
    std::size_t top = std::numeric_limits<std::size_t>::max(), left = top;
    bool is_second = false;
    for (const std::uint32_t v : triangle) {
      if (v >= surface.grid.size()) return false;
      is_second = is_second || surface.grid[v].line >= picture_lines;
      top = std::min<std::size_t>(top, surface.grid[v].line);
      left = std::min<std::size_t>(left, surface.grid[v].boundary);
    }
    if (is_second) continue;
    unsigned corners = 0;
    for (const std::uint32_t v : triangle) {
      const std::size_t down = surface.grid[v].line - top;
      const std::size_t right = surface.grid[v].boundary - left;
      if (down > 1 || right > 1) return false;
      corners |= 1U << (down == 0 ? (right == 0 ? 0 : 3) : (right == 0 ? 1 : 2));
    }
    const unsigned missing = 0xfU & ~corners;
    if (missing == 0 || (missing & (missing - 1)) != 0) return false;
    out.triangles[out.at(top, left)] |= static_cast<std::uint8_t>(missing);
  }
  return true;
}

/// What a cell of two lines has, of the upper and the lower one that it covers. A cell without one of its
/// outer corners is one triangle of three.
std::uint8_t joined(std::uint8_t upper, std::uint8_t lower) {
  const auto whole = [](std::uint8_t cell) {
    return cell == grid_cell::kStraight || cell == grid_cell::kTurned;
  };
  constexpr std::uint8_t kUpperCorners = 1U << 0 | 1U << 3, kLowerCorners = 1U << 1 | 1U << 2;
  if (whole(upper) && whole(lower)) return grid_cell::kStraight;
  if (whole(lower) && (upper == 1U << 0 || upper == 1U << 3)) return upper & kUpperCorners;
  if (whole(upper) && (lower == 1U << 1 || lower == 1U << 2)) return lower & kLowerCorners;
  return 0;
}

/// Pixels of `across` in a row, each the sum of `down`, to one.
template <int kChannels>
void join_pairs(const std::uint16_t* sums, int width, int half, int shift, std::uint8_t* to) {
  for (int x = 0; x < width; ++x, sums += 2 * kChannels, to += kChannels)
    for (int c = 0; c < kChannels; ++c)
      to[c] = static_cast<std::uint8_t>((sums[c] + sums[c + kChannels] + half) >> shift);
}
void join(const std::uint16_t* sums, int channels, int across, int down, int width, std::uint8_t* to) {
  const int shift = (across == 2 ? 1 : 0) + (down == 2 ? 1 : 0);
  const int half = (1 << shift) / 2;
  if (across == 1) {
    for (int i = 0; i < width * channels; ++i) to[i] = static_cast<std::uint8_t>((sums[i] + half) >> shift);
  } else if (channels == 1) {
    join_pairs<1>(sums, width, half, shift, to);
  } else {
    join_pairs<3>(sums, width, half, shift, to);
  }
}

/// Nothing in it, but its memory.
void clear(Surface& surface) {
  surface.positions.clear();
  surface.normals.clear();
  surface.texture_coordinates.clear();
  surface.triangles.clear();
  surface.grid.clear();
  surface.sigmas_m.clear();
  surface.interpolated.clear();
}

template <typename T>
void keep(const std::vector<T>& from, const std::vector<std::uint32_t>& kept, std::vector<T>& to) {
  to.clear();
  if (from.empty()) return;
  to.reserve(kept.size());
  for (const std::uint32_t v : kept) to.push_back(from[v]);
}

}  // namespace

bool halve_lines(const Surface& surface, int lines, Surface& out) {
  clear(out);
  Places places;
  if (surface.grid.size() != surface.positions.size() || !find_vertices(surface, lines, places) ||
      !find_triangles(surface, lines, places))
    return false;
  std::vector<std::uint32_t> kept, now(surface.grid.size(), kNone);
  for (std::uint32_t v = 0; v < surface.grid.size(); ++v) {
    if (surface.grid[v].line % 2 != 0 || surface.grid[v].line >= lines) continue;
    now[v] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(v);
  }
  keep(surface.positions, kept, out.positions);
  keep(surface.normals, kept, out.normals);
  keep(surface.texture_coordinates, kept, out.texture_coordinates);
  keep(surface.grid, kept, out.grid);
  keep(surface.sigmas_m, kept, out.sigmas_m);
  keep(surface.interpolated, kept, out.interpolated);
  for (GridPoint& p : out.grid) p.line /= 2;

  const std::size_t two_lines = 2 * places.stride;
  for (std::size_t upper = 0; upper + two_lines + 1 < places.vertex.size();
       upper += (upper + 1) % places.stride == 0 ? places.stride + 1 : 1) {
    const std::size_t lower = upper + places.stride;
    const std::uint8_t cell = joined(places.triangles[upper], places.triangles[lower]);
    if (cell == 0) continue;
    const std::uint32_t corners[4] = {places.vertex[upper], places.vertex[upper + two_lines],
                                      places.vertex[upper + two_lines + 1], places.vertex[upper + 1]};
    const auto add = [&](int a, int b, int c) {
      out.triangles.push_back({now[corners[a]], now[corners[b]], now[corners[c]]});
    };
    if (cell != grid_cell::kStraight) {
      if (cell == 1U << 0) add(1, 2, 3);
      if (cell == 1U << 1) add(0, 2, 3);
      if (cell == 1U << 2) add(0, 1, 3);
      if (cell == 1U << 3) add(0, 1, 2);
      continue;
    }
    const auto column = [&](int c) { return surface.grid[corners[c]].column_px; };
    if (std::abs(column(2) - column(0)) <= std::abs(column(3) - column(1))) {
      add(0, 1, 2);
      add(2, 3, 0);
    } else {
      add(1, 2, 3);
      add(3, 0, 1);
    }
  }
  return true;
}

void halve_lines(StripeGrid& grid, std::span<std::vector<std::uint8_t>* const> planes) {
  static const auto kJoined = [] {
    std::array<std::uint8_t, 256> all{};
    for (unsigned i = 0; i < all.size(); ++i)
      all[i] = joined(static_cast<std::uint8_t>(i >> 4), static_cast<std::uint8_t>(i & 15U));
    return all;
  }();
  grid.lines = grid.picture_lines();  // without the second places
  grid.twice = false;
  const auto stride = static_cast<std::size_t>(grid.stride());
  const int lines = (grid.lines + 1) / 2;
  const std::size_t size = grid.at(lines, 0);
  const auto halve_plane = [&](auto& plane) {
    if (plane.empty()) return;
    for (std::size_t l = 1; l < static_cast<std::size_t>(lines); ++l)
      std::copy_n(plane.data() + 2 * l * stride, stride, plane.data() + l * stride);
    plane.resize(size);
    std::fill_n(plane.data() + size - StripeGrid::kMargin, StripeGrid::kMargin,
                std::is_same_v<decltype(plane), std::vector<std::int32_t>&> ? StripeGrid::kAbsent : 0);
  };
  for (int l = 0; 2 * l + 1 < grid.lines; ++l) {
    std::uint8_t* to = grid.cells.data() + static_cast<std::size_t>(l) * stride;
    const std::uint8_t* upper = grid.cells.data() + static_cast<std::size_t>(2 * l) * stride;
    for (std::size_t i = 0; i < stride; ++i) to[i] = kJoined[upper[i] << 4U | (upper[i + stride] & 15U)];
  }
  grid.cells.resize(size);
  std::fill(grid.cells.data() + grid.at(lines - 1, 0), grid.cells.data() + size, std::uint8_t{0});
  halve_plane(grid.columns);
  halve_plane(grid.sigmas);
  halve_plane(grid.interpolated);
  for (std::vector<std::uint8_t>* plane : planes) halve_plane(*plane);
  grid.lines = lines;
  grid.vertices = static_cast<std::uint32_t>(
      std::ranges::count_if(grid.columns, [](std::int32_t c) { return c != StripeGrid::kAbsent; }));
  grid.triangles = 0;
  for (const std::uint8_t cell : grid.cells) grid.triangles += static_cast<unsigned>(std::popcount(cell));
}

void halve(const Image8& picture, Image8& out) {
  const int across = picture.width() % 2 == 0 ? 2 : 1;
  const int down = picture.height() % 2 == 0 ? 2 : 1;
  const int width = picture.width() / across, height = picture.height() / down;
  fit_image(width, height, picture.channels(), out);
  // Two steps, so that the first is one of vectors: half of the work, and of the memory that is read.
  std::vector<std::uint16_t> sums(static_cast<std::size_t>(picture.width() * picture.channels()));
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* upper = picture.row(y * down);
    const std::uint8_t* lower = picture.row(y * down + down - 1);
    for (std::size_t i = 0; i < sums.size(); ++i)
      sums[i] = static_cast<std::uint16_t>(upper[i] + (down == 2 ? lower[i] : 0));
    join(sums.data(), picture.channels(), across, down == 2 ? 2 : 1, width, out.row(y));
  }
}

}  // namespace relievo
