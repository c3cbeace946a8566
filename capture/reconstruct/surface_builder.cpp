// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/surface_builder.h"

namespace relievo {
namespace {

// A dense piece of surface has about as many pixels for each boundary as stripes are wide.
constexpr int kPixelsForBoundary = 6;
constexpr int kLinesApart = 8;  // that tell the usual standard deviation

}  // namespace

SurfaceBuilder::SurfaceBuilder(const Rig& rig, int line_step_px, const SurfaceBuilderOptions& options,
                               int least_component)
    : width_px_(rig.camera.width),
      height_px_(rig.camera.height),
      line_step_px_(line_step_px),
      least_component_(least_component),
      options_(options),
      depth_slope_(rig) {}

/// The median on some of the lines, which is as good; 0 where it is not known.
float SurfaceBuilder::usual_sigma_px(const DecodedGrid& grid) {
  sigmas_px_.reset(1);
  std::vector<float>& sample = sigmas_px_.of(0);
  const auto boundaries = static_cast<std::size_t>(grid.boundaries());
  std::size_t count = 0;
  for (int line = 0; line < grid.lines(); line += kLinesApart) {
    sample.resize(count + boundaries);
    const float* column_px = grid.column_px(line);
    const float* sigma_px = grid.sigma_px(line);
    for (std::size_t b = 0; b < boundaries; ++b) {
      sample[count] = sigma_px[b];
      count += column_px[b] == column_px[b];
    }
  }
  sample.resize(count);
  return sigmas_px_.median(0);
}

/// Returns how many places were filled.
std::size_t SurfaceBuilder::fill(const ColumnScale& scale, const Triangulator& triangulator,
                                 DecodedGrid& grid) {
  find_holes(options_.fill_holes, scale, grid, holes_);
  grid.start_interpolated();
  std::size_t filled = 0;
  for (const Hole& hole : holes_) {
    const int b = hole.boundary;
    grid.put(hole.line, b, hole.column_px, 0, 0);
    const auto position = triangulator.point(b, hole.line, hole.column_px);
    if (!position) continue;
    const PointRow points = grid.points(hole.line);
    points.x[b] = (*position)[0];
    points.y[b] = (*position)[1];
    points.z[b] = (*position)[2];
    grid.interpolated_of(hole.line)[b] = 1;
    ++filled;
  }
  return filled;
}

void SurfaceBuilder::build(DecodedGrid& grid, const std::vector<SecondPlace>& second,
                           const Triangulator& triangulator, WorkerPool& pool, Surface& out,
                           FilterCounts& counts) {
  const ColumnScale scale{line_step_px_, usual_sigma_px(grid)};
  if (options_.fill_holes > 0) counts.filled += fill(scale, triangulator, grid);
  find_links(grid, scale, pool, links_);
  const SurfacePicture picture{width_px_, height_px_, line_step_px_, depth_slope_};
  SurfaceCounts made;
  if (options_.dense) {
    const DenseCounts sampled = dense_.sample(grid, links_, triangulator, width_px_, pool, pixels_);
    counts.interpolated += sampled.interpolated;
    counts.alone += sampled.alone;
    counts.duplicate += sampled.duplicate;
    made = build_surface(pixels_.pixels,
                         {.least_component = kPixelsForBoundary * least_component_,
                          .pool = &pool,
                          .picture = &picture,
                          .boundaries = pixels_.boundaries.data()},
                         scratch_, out);
  } else {
    const SurfaceOptions options{
        .least_component = least_component_, .links = &links_, .pool = &pool, .picture = &picture};
    made = build_surface(grid, options, scratch_, out);
    made.small_component += second_.add(second, grid, scale, options, triangulator, out);
  }
  counts.step += made.step;
  counts.edge_on += made.edge_on;
  counts.small_component += made.small_component;
}

}  // namespace relievo
