// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface.h"

#include <algorithm>
#include <utility>

#include "capture/reconstruct/surface_writer.h"

namespace relievo {
namespace {

/// One call's grid: what the steps below share.
class Builder {
 public:
  Builder(const DecodedGrid& grid, const SurfaceOptions& options, SurfaceScratch& scratch)
      : grid_(grid), stride_(grid.stride()), options_(options), scratch_(scratch) {
    const auto lines = static_cast<std::size_t>(grid.lines());
    scratch.pieces.reset(grid.boundaries(), grid.lines());
    scratch.normals.resize(3 * lines * stride_);
    if (options.links == nullptr) {
      scratch.all_links.assign(stride_ / 8 + 1, 0xff);
      scratch.no_links.assign(stride_ / 8 + 1, 0);
    }
    scratch.workers.resize(options.pool != nullptr ? static_cast<std::size_t>(options.pool->workers()) : 1);
    for (auto& worker : scratch.workers) {
      worker.counts = {};
      worker.rows.resize(SurfaceScratch::Worker::kRows * stride_);
      // Whole words of bits are made of them.
      worker.cells.assign(std::max(stride_, 64 * scratch.pieces.words()), 0);
    }
  }

  SurfaceCounts build(Surface& out) {
    for_lines([&](int begin, int end, SurfaceScratch::Worker& worker) { make_cells(begin, end, worker); });
    SurfaceCounts counts;
    for (const auto& worker : scratch_.workers) {
      counts.step += worker.counts.step;
      counts.edge_on += worker.counts.edge_on;
    }
    counts.small_component = scratch_.pieces.keep(options_.least_component, options_.pool);
    SurfaceWriter::fit(scratch_.pieces, grid_.lines(), options_, out);
    for_lines([&](int begin, int end, SurfaceScratch::Worker& worker) {
      SurfaceWriter(grid_, options_, scratch_, worker, out).write(begin, end);
    });
    return counts;
  }

 private:
  template <typename Work>
  void for_lines(const Work& work) {
    if (options_.pool == nullptr) {
      work(0, grid_.lines(), scratch_.workers.front());
      return;
    }
    options_.pool->for_ranges(grid_.lines(), [&](int begin, int end, int worker) {
      work(begin, end, scratch_.workers[static_cast<std::size_t>(worker)]);
    });
  }

  /// With views at `views`.
  VertexRow vertices(int line, float* views) const {
    const float* x = grid_.x(line);
    const float* y = grid_.y(line);
    const float* z = grid_.z(line);
    // A cell looks at the place to its right.
    cell_kernels().views(x, y, z, grid_.boundaries() + 8, views, views + stride_);
    return {x, y, z, views, views + stride_};
  }

  CellLinks links(int line) const {
    if (options_.links == nullptr) {
      const std::uint8_t* all = scratch_.all_links.data();
      return {all, scratch_.no_links.data(), all, all};
    }
    return {options_.links->along(line), options_.links->sure_along(line), options_.links->across(line),
            options_.links->across(line + 1)};
  }

  /// Cells above and below the lines [begin, end), and their vertices' normals. Lines outside of the grid
  /// hold nothing.
  void make_cells(int begin, int end, SurfaceScratch::Worker& worker) {
    float* rows = worker.rows.data();
    float* views_above = rows;
    float* views_below = rows + 2 * stride_;
    const auto plane = static_cast<std::ptrdiff_t>(stride_);
    // What cells on the border of the range add to lines that are another worker's.
    const NormalRow unused{rows + 4 * stride_, plane};
    const auto normals = [&](int line) {
      if (line < begin || line >= end) return unused;
      return NormalRow{scratch_.normals.data() + static_cast<std::size_t>(3 * line) * stride_, plane};
    };
    CellCounts not_counted;
    std::fill_n(unused.planes, 3 * stride_, 0.F);
    VertexRow above = vertices(begin - 1, views_above);
    for (int line = begin - 1; line < end; ++line) {
      const VertexRow below = vertices(line + 1, views_below);
      cell_kernels().make({above, below, links(line), grid_.boundaries()},
                          {options_.depth_step_ratio, options_.least_facing}, worker.cells.data(),
                          normals(line), normals(line + 1), line < begin ? not_counted : worker.counts);
      scratch_.pieces.read_cells(worker.cells.data(), worker.below);
      if (line >= begin) scratch_.pieces.read_line(line, worker.above, worker.below);
      above = below;
      std::swap(views_above, views_below);
      std::swap(worker.above, worker.below);
    }
  }

  const DecodedGrid& grid_;
  const std::size_t stride_;
  const SurfaceOptions& options_;
  SurfaceScratch& scratch_;
};

}  // namespace

SurfaceCounts build_surface(const DecodedGrid& grid, const SurfaceOptions& options, SurfaceScratch& scratch,
                            Surface& out) {
  return Builder(grid, options, scratch).build(out);
}

}  // namespace relievo
