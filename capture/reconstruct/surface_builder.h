// SPDX-License-Identifier: Apache-2.0
// From decoded boundaries with their points to the surface that is sent: holes, depth steps, the dense
// option, connectivity, normals, texture coordinates and standard deviations.
#pragma once

#include <vector>

#include "base/filter_counts.h"
#include "base/frame3d.h"
#include "base/parallel.h"
#include "base/rig.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/dense.h"
#include "capture/reconstruct/depth_sigma.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/second_places.h"
#include "capture/reconstruct/second_surface.h"
#include "capture/reconstruct/surface.h"
#include "capture/reconstruct/surface_builder_options.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class SurfaceBuilder {
 public:
  /// `least_component` (SurfaceOptions) is in boundaries, of a dense surface, too.
  SurfaceBuilder(const Rig& rig, int line_step_px, const SurfaceBuilderOptions& options,
                 int least_component = SurfaceOptions{}.least_component);

  /// Of boundaries with their points, and what lines show of them a second time, which is no part of a dense
  /// surface: `grid` gains what fills holes. Fills `out` but for what it holds of old, and adds what the
  /// filters did to `counts`. `triangulator` must be of the same rig, pattern and lines.
  void build(DecodedGrid& grid, const std::vector<SecondPlace>& second, const Triangulator& triangulator,
             WorkerPool& pool, Surface& out, FilterCounts& counts);

 private:
  float usual_sigma_px(const DecodedGrid& grid);
  std::size_t fill(const ColumnScale& scale, const Triangulator& triangulator, DecodedGrid& grid);

  int width_px_, height_px_, line_step_px_, least_component_;
  SurfaceBuilderOptions options_;
  DepthSlope depth_slope_;
  RankedSample sigmas_px_;
  std::vector<Hole> holes_;
  GridLinks links_;
  DenseSampler dense_;
  DenseGrid pixels_;
  SurfaceScratch scratch_;
  SecondSurface second_;
};

}  // namespace relievo
