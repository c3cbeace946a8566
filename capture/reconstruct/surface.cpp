// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

namespace relievo {
namespace {

constexpr int kPlanes = 5;
constexpr float kSure_px = 0.12F;  // of columns that tell that a boundary goes on

/// One call's grid: what the steps below share.
class Grid {
 public:
  Grid(const std::vector<GridVertex>& vertices, int boundaries, int lines, const SurfaceOptions& options,
       SurfaceScratch& scratch)
      : vertices_(vertices),
        boundaries_(boundaries),
        lines_(lines),
        stride_((boundaries + 7) / 8 * 8 + VertexRow::kPadding),
        options_(options),
        scratch_(scratch) {
    scratch.workers.resize(options.pool != nullptr ? static_cast<std::size_t>(options.pool->threads()) : 1);
    for (auto& worker : scratch.workers) worker.counts = {};
  }

  SurfaceCounts build(Surface& out) {
    SurfaceCounts counts;
    counts.duplicate = place_vertices();
    for_lines([&](int begin, int end, SurfaceScratch::Worker& worker) { make_cells(begin, end, worker); });
    for (const auto& worker : scratch_.workers) {
      counts.step += worker.counts.step;
      counts.edge_on += worker.counts.edge_on;
    }
    find_components();
    counts.small_component = count_what_is_kept(out);
    for_lines([&](int begin, int end, SurfaceScratch::Worker&) {
      for (int line = begin; line < end; ++line) number(line);
    });
    for_lines([&](int begin, int end, SurfaceScratch::Worker&) {
      for (int line = begin; line < end; ++line) {
        write_vertices(line, out);
        write_triangles(line, out);
      }
    });
    return counts;
  }

 private:
  template <typename Work>
  void for_lines(const Work& work) {
    if (options_.pool == nullptr) {
      work(0, lines_, scratch_.workers.front());
      return;
    }
    options_.pool->for_ranges(lines_, [&](int begin, int end, int worker) {
      work(begin, end, scratch_.workers[static_cast<std::size_t>(worker)]);
    });
  }

  std::size_t cell(int line, int boundary) const {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_) +
           static_cast<std::size_t>(boundary);
  }
  float* plane(int line, int which) {
    return scratch_.planes.data() + static_cast<std::size_t>(line * kPlanes + which) * stride_;
  }
  std::uint8_t* cells(int line) { return scratch_.cells.data() + static_cast<std::size_t>(line) * stride_; }
  VertexRow row(int line) {
    return {plane(line, 0), plane(line, 1), plane(line, 2), plane(line, 3), plane(line, 4)};
  }

  /// The better one of each place. Returns how many were not.
  std::size_t find_places() {
    std::size_t duplicates = 0;
    if (options_.places != nullptr) {
      places_ = options_.places->data();
      return 0;
    }
    scratch_.vertex.assign(cell(lines_, 0), -1);
    places_ = scratch_.vertex.data();
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const GridPoint& at = vertices_[i].at;
      std::int32_t& slot =
          scratch_.vertex[cell(at.line, options_.by_pixel ? static_cast<int>(at.column_px) : at.boundary)];
      duplicates += slot >= 0;
      if (slot < 0 || better(vertices_[i], vertices_[static_cast<std::size_t>(slot)]))
        slot = static_cast<std::int32_t>(i);
    }
    return duplicates;
  }

  std::size_t place_vertices() {
    const std::size_t duplicates = find_places();
    scratch_.planes.resize(static_cast<std::size_t>(lines_ * kPlanes) * stride_);
    scratch_.normals.resize(3 * cell(lines_, 0));
    scratch_.cells.resize(static_cast<std::size_t>(lines_) * stride_);
    scratch_.index.resize(cell(lines_, 0));
    for_lines([&](int begin, int end, SurfaceScratch::Worker&) {
      for (int line = begin; line < end; ++line) fill_row(line);
    });
    return duplicates;
  }

  void fill_row(int line) {
    std::fill_n(plane(line, 0), kPlanes * stride_, std::numeric_limits<float>::quiet_NaN());
    for (int b = 0; b < boundaries_; ++b) {
      const std::int32_t vertex = places_[cell(line, b)];
      if (vertex < 0) continue;
      const Vec3f& p = vertices_[static_cast<std::size_t>(vertex)].position;
      for (std::size_t axis = 0; axis < 3; ++axis) plane(line, static_cast<int>(axis))[b] = p[axis];
    }
    const VertexRow r = row(line);
    float* x_z = plane(line, 3);
    float* y_z = plane(line, 4);
    for (int b = 0; b < boundaries_; ++b) {
      x_z[b] = r.x[b] / r.z[b];
      y_z[b] = r.y[b] / r.z[b];
    }
  }

  /// Cells below the lines [begin, end), and their vertices' normals.
  void make_cells(int begin, int end, SurfaceScratch::Worker& worker) {
    const auto row_size = static_cast<std::size_t>(12) * stride_;
    worker.normals.resize(2 * row_size);
    CellNormals above{worker.normals.data(), static_cast<std::ptrdiff_t>(stride_)};
    CellNormals below{worker.normals.data() + row_size, static_cast<std::ptrdiff_t>(stride_)};
    // The cells above the first line are another worker's, who writes and counts them.
    CellCounts not_counted;
    worker.links.resize(4 * stride_);
    make_row(begin - 1, above, worker, worker.links.data() + 3 * stride_, not_counted);
    for (int line = begin; line < end; ++line) {
      make_row(line, below, worker, cells(line), worker.counts);
      float* normals = scratch_.normals.data() + 3 * cell(line, 0);
      cell_kernels().normals(above, below, boundaries_, normals, boundaries_);
      std::swap(above, below);
    }
  }

  /// Between `line` and the next one; none outside the grid.
  void make_row(int line, const CellNormals& normals, SurfaceScratch::Worker& worker, std::uint8_t* to,
                CellCounts& counts) {
    if (line < 0 || line + 1 >= lines_) {
      std::fill_n(normals.planes, 12 * stride_, 0.F);
      std::fill_n(to, stride_, std::uint8_t{0});
      return;
    }
    std::uint8_t* links = worker.links.data();
    if (options_.links != nullptr) {
      const auto count = static_cast<std::size_t>(boundaries_);
      std::memcpy(links, options_.links->along.data() + cell(line, 0), count);
      std::memcpy(links + stride_, options_.links->across.data() + cell(line, 0), count);
      std::memcpy(links + 2 * stride_, options_.links->across.data() + cell(line + 1, 0), count);
    } else {
      std::fill_n(links, 3 * stride_, std::uint8_t{1});
    }
    // The last of them has nothing to its right.
    cell_kernels().make(row(line), row(line + 1), {links, links + stride_, links + 2 * stride_}, boundaries_,
                        {options_.depth_step_ratio, options_.least_facing}, to, normals, counts);
  }

  std::int32_t root(std::int32_t run) {
    auto& parent = scratch_.parent;
    while (parent[static_cast<std::size_t>(run)] != run) {
      auto& up = parent[static_cast<std::size_t>(run)];
      up = parent[static_cast<std::size_t>(up)];  // halves the path
      run = up;
    }
    return run;
  }
  void join(std::int32_t a, std::int32_t b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    scratch_.parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    scratch_.size[static_cast<std::size_t>(std::min(a, b))] +=
        scratch_.size[static_cast<std::size_t>(std::max(a, b))];
  }

  /// Which sides of a cell its triangles join: bit c from corner c to the next.
  static constexpr std::array<std::uint8_t, 32> kJoinedSides = [] {
    std::array<std::uint8_t, 32> out{};
    for (std::size_t bits = 0; bits < 32; ++bits) {
      const bool first = bits & cell::kFirstJoins;
      const bool second = bits & cell::kSecondJoins;
      const int turned = (first ? 2 | 4 : 0) | (second ? 8 | 1 : 0);
      const int straight = (first ? 1 | 2 : 0) | (second ? 4 | 8 : 0);
      out[bits] = static_cast<std::uint8_t>(bits & cell::kTurned ? turned : straight);
    }
    return out;
  }();

  /// A boundary that goes on from line to line is a surface, even one too narrow for triangles.
  bool goes_on_from_above(int line, int b) const {
    if (options_.links == nullptr || line == 0 || options_.links->along[cell(line - 1, b)] == 0) return false;
    const auto sigma_px = [&](int l) {
      return vertices_[static_cast<std::size_t>(places_[cell(l, b)])].at.sigma_px;
    };
    return sigma_px(line - 1) < kSure_px && sigma_px(line) < kSure_px;
  }

  /// Runs of vertices that triangles join along a line, and those that they, or boundaries, join across
  /// lines. Sizes are twice the vertices, but of those that no triangle joins to the next on the line.
  void find_components() {
    std::int32_t* run = scratch_.index.data();
    scratch_.parent.clear();
    scratch_.size.clear();
    for (int line = 0; line < lines_; ++line) {
      const std::uint8_t* above = line > 0 ? cells(line - 1) : nullptr;
      const std::uint8_t* below = cells(line);
      bool on = false;    // joined to the one before
      bool down = false;  // the cell on the left joins this vertex to the one above it
      std::int32_t now = -1;
      std::int32_t joined_above = -1;  // the last run above that this one was joined to
      std::int32_t length = 0;
      const auto end_run = [&] {
        if (length > 0) scratch_.size[static_cast<std::size_t>(root(now))] += length > 1 ? 2 * length : 1;
        length = 0;
      };
      for (int b = 0; b < boundaries_; ++b) {
        const std::size_t at = cell(line, b);
        const int sides_above = above != nullptr ? kJoinedSides[above[b]] : 0;
        if (places_[at] < 0) {
          run[at] = -1;
        } else {
          if (!on || length == 0) {
            end_run();
            now = static_cast<std::int32_t>(scratch_.parent.size());
            joined_above = -1;
            scratch_.parent.push_back(now);
            scratch_.size.push_back(0);
          }
          run[at] = now;
          ++length;
          if (down || (sides_above & 1) || goes_on_from_above(line, b)) {
            const std::int32_t other = run[at - static_cast<std::size_t>(boundaries_)];
            if (other != joined_above) join(now, other);
            joined_above = other;
          }
        }
        on = (kJoinedSides[below[b]] & 8) || (sides_above & 2);
        down = sides_above & 4;
      }
      end_run();
    }
  }

  /// Each line's place in the output, whose vectors get their sizes. Returns how many vertices are in small
  /// pieces.
  std::size_t count_what_is_kept(Surface& out) {
    const std::size_t runs = scratch_.parent.size();
    scratch_.kept.resize(runs);
    for (std::size_t r = 0; r < runs; ++r) {
      scratch_.kept[r] = scratch_.size[static_cast<std::size_t>(root(static_cast<std::int32_t>(r)))] + 1 >=
                         2 * options_.least_component;
    }
    auto& vertices = scratch_.vertices_before;
    auto& triangles = scratch_.triangles_before;
    vertices.resize(static_cast<std::size_t>(lines_) + 1);
    triangles.resize(static_cast<std::size_t>(lines_) + 1);
    for (auto& worker : scratch_.workers) worker.small = 0;
    for_lines([&](int begin, int end, SurfaceScratch::Worker& worker) {
      for (int line = begin; line < end; ++line) {
        std::uint32_t kept = 0;
        std::uint32_t made = 0;
        const std::uint8_t* bits = cells(line);
        for (int b = 0; b < boundaries_; ++b) {
          std::int32_t& run = scratch_.index[cell(line, b)];
          if (run < 0) continue;
          if (scratch_.kept[static_cast<std::size_t>(run)] != 0) {
            ++kept;
          } else {
            ++worker.small;
            run = -1;
          }
        }
        for (int b = 0; b < boundaries_; ++b) {
          if (!(bits[b] & (cell::kFirst | cell::kSecond))) continue;
          made +=
              cell_is_kept(line, b) ? ((bits[b] & cell::kFirst) != 0) + ((bits[b] & cell::kSecond) != 0) : 0;
        }
        vertices[static_cast<std::size_t>(line)] = kept;
        triangles[static_cast<std::size_t>(line)] = made;
      }
    });
    std::size_t small = 0;
    for (const auto& worker : scratch_.workers) small += worker.small;
    for (auto* counts : {&vertices, &triangles}) {
      std::uint32_t before = 0;
      for (std::uint32_t& count : *counts) before += std::exchange(count, before);
    }
    out.positions.resize(vertices.back());
    out.normals.resize(vertices.back());
    out.grid.resize(vertices.back());
    out.triangles.resize(triangles.back());
    return small;
  }

  void number(int line) {
    auto next = static_cast<std::int32_t>(scratch_.vertices_before[static_cast<std::size_t>(line)]);
    for (int b = 0; b < boundaries_; ++b) {
      std::int32_t& index = scratch_.index[cell(line, b)];
      if (index >= 0) index = next++;
    }
  }

  /// Of a cell with triangles: whether they are in no small piece. All of them have the upper corner of the
  /// diagonal.
  bool cell_is_kept(int line, int b) const {
    const bool turned =
        scratch_.cells[static_cast<std::size_t>(line) * stride_ + static_cast<std::size_t>(b)] &
        cell::kTurned;
    return scratch_.index[cell(line, turned ? b + 1 : b)] >= 0;
  }

  void write_vertices(int line, Surface& out) const {
    const float* normals = scratch_.normals.data() + 3 * cell(line, 0);
    const auto stride = static_cast<std::size_t>(boundaries_);
    std::size_t to = scratch_.vertices_before[static_cast<std::size_t>(line)];
    for (std::size_t b = 0; b < stride; ++b) {
      if (scratch_.index[cell(line, 0) + b] < 0) continue;
      const GridVertex& v = vertices_[static_cast<std::size_t>(places_[cell(line, 0) + b])];
      out.positions[to] = v.position;
      out.grid[to] = v.at;
      out.normals[to] = {normals[b], normals[stride + b], normals[2 * stride + b]};
      ++to;
    }
  }

  void write_triangles(int line, Surface& out) {
    std::size_t to = scratch_.triangles_before[static_cast<std::size_t>(line)];
    const std::uint8_t* bits = cells(line);
    for (int b = 0; b < boundaries_; ++b) {
      if (!(bits[b] & (cell::kFirst | cell::kSecond)) || !cell_is_kept(line, b)) continue;
      const auto at = [&](std::size_t i) { return static_cast<std::uint32_t>(scratch_.index[i]); };
      std::array<std::uint32_t, 4> q{at(cell(line, b)), at(cell(line + 1, b)), at(cell(line + 1, b + 1)),
                                     at(cell(line, b + 1))};
      if (bits[b] & cell::kTurned) q = {q[1], q[2], q[3], q[0]};
      if (bits[b] & cell::kFirst) out.triangles[to++] = {q[0], q[1], q[2]};
      if (bits[b] & cell::kSecond) out.triangles[to++] = {q[2], q[3], q[0]};
    }
  }

  const std::vector<GridVertex>& vertices_;
  const int boundaries_, lines_;
  const std::size_t stride_;
  const SurfaceOptions& options_;
  SurfaceScratch& scratch_;
  const std::int32_t* places_ = nullptr;  // [line][boundary]: of vertices_, or -1
};

}  // namespace

SurfaceCounts build_surface(const std::vector<GridVertex>& vertices, int boundaries, int lines,
                            const SurfaceOptions& options, SurfaceScratch& scratch, Surface& out) {
  return Grid(vertices, boundaries, lines, options, scratch).build(out);
}

}  // namespace relievo
