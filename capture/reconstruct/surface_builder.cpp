// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_builder.h"

#include <algorithm>

namespace relievo {
namespace {

// A dense piece of surface has about as many pixels for each boundary as stripes are wide.
constexpr int kLeastDenseComponent = 60;
constexpr int kLinesApart = 8;  // that tell the usual standard deviation

}  // namespace

SurfaceBuilder::SurfaceBuilder(const Rig& rig, int boundaries, int lines, int line_step_px,
                               const SurfaceBuilderOptions& options)
    : rig_(rig),
      boundaries_(boundaries),
      lines_(lines),
      line_step_px_(line_step_px),
      options_(options),
      depth_slope_(rig) {}

std::size_t SurfaceBuilder::fill_columns(const std::vector<GridVertex>& vertices) {
  std::size_t duplicates = 0;
  columns_.reset(boundaries_, lines_, kNoColumn);
  vertex_.assign(static_cast<std::size_t>(boundaries_) * static_cast<std::size_t>(lines_), -1);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const GridPoint& at = vertices[i].at;
    std::int32_t& slot =
        vertex_[static_cast<std::size_t>(at.line) * static_cast<std::size_t>(boundaries_) + at.boundary];
    duplicates += slot >= 0;
    if (slot >= 0 && !better(vertices[i], vertices[static_cast<std::size_t>(slot)])) continue;
    slot = static_cast<std::int32_t>(i);
    columns_.line(at.line)[at.boundary] = at.column_px;
  }
  return duplicates;
}

/// The median on some of the lines, which is as good; 0 where it is not known.
float SurfaceBuilder::usual_sigma_px(const std::vector<GridVertex>& vertices) {
  sigmas_px_.reset(1);
  for (const GridVertex& v : vertices)
    if (v.at.line % kLinesApart == 0) sigmas_px_.of(0).push_back(v.at.sigma_px);
  return sigmas_px_.median(0);
}

void SurfaceBuilder::finish(WorkerPool& pool, Surface& out) const {
  const auto width = static_cast<float>(rig_.camera.width);
  const auto height = static_cast<float>(rig_.camera.height);
  const std::size_t count = out.grid.size();
  out.texture_coordinates.resize(count);
  out.sigmas_m.resize(count);
  out.interpolated.resize(count);
  pool.for_ranges(static_cast<int>(count), [&](int begin, int end, int) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const GridPoint& at = out.grid[i];
      out.texture_coordinates[i] = {(at.column_px + 0.5F) / width,
                                    (static_cast<float>(at.line * line_step_px_) + 0.5F) / height};
      out.sigmas_m[i] = at.sigma_px > 0 ? at.sigma_px * depth_slope_.metres_per_px(out.positions[i]) : 0;
      out.interpolated[i] = at.interpolated;
    }
  });
}

void SurfaceBuilder::build(DecodedGrid& grid, const Triangulator& triangulator, WorkerPool& pool,
                           Surface& out, FilterCounts& counts) {
  std::vector<GridVertex>& vertices = vertices_;
  vertices.clear();
  for (int line = 0; line < grid.lines(); ++line) {
    const PointRow points = grid.points(line);
    for (int b = 0; b < grid.boundaries(); ++b) {
      if (!(points.z[b] > 0)) continue;
      vertices.push_back({{static_cast<std::uint16_t>(b), static_cast<std::uint16_t>(line),
                           grid.column_px(line)[b], grid.sigma_px(line)[b]},
                          {points.x[b], points.y[b], points.z[b]},
                          grid.slope(line)[b]});
    }
  }
  const std::size_t duplicates = fill_columns(vertices);
  const ColumnScale scale{line_step_px_, usual_sigma_px(vertices)};
  fill_holes(options_.fill_holes, scale, columns_, holes_);
  for (const Hole& hole : holes_) {
    const auto position = triangulator.point(hole.boundary, hole.line, hole.column_px);
    if (!position) continue;
    vertex_[static_cast<std::size_t>(hole.line) * static_cast<std::size_t>(boundaries_) + hole.boundary] =
        static_cast<std::int32_t>(vertices.size());
    vertices.push_back({{hole.boundary, hole.line, hole.column_px, 0, true}, *position, 0});
    ++counts.filled;
  }
  find_links(columns_, scale, pool, links_);
  SurfaceCounts made;
  if (options_.dense) {
    const DenseCounts sampled =
        dense_.sample(vertices, columns_, links_, triangulator, rig_.camera.width, pool, pixels_);
    counts.interpolated += sampled.interpolated;
    counts.alone += sampled.alone;
    made = build_surface(pixels_, rig_.camera.width, lines_,
                         {.least_component = kLeastDenseComponent, .pool = &pool, .by_pixel = true}, scratch_,
                         out);
  } else {
    made = build_surface(vertices, boundaries_, lines_, {.links = &links_, .pool = &pool, .places = &vertex_},
                         scratch_, out);
    made.duplicate = duplicates;
  }
  counts.duplicate += made.duplicate;
  counts.step += made.step;
  counts.edge_on += made.edge_on;
  counts.small_component += made.small_component;
  finish(pool, out);
}

}  // namespace relievo
