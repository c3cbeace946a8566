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
#include "capture/reconstruct/surface.h"
#include "capture/reconstruct/surface_builder_options.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class SurfaceBuilder {
 public:
  SurfaceBuilder(const Rig& rig, int boundaries, int lines, int line_step_px,
                 const SurfaceBuilderOptions& options);

  /// Of boundaries with their points: `grid` gains what fills holes. Fills `out` but for what it holds of
  /// old, and adds what the filters did to `counts`. `triangulator` must be of the same rig, pattern and
  /// lines.
  void build(DecodedGrid& grid, const Triangulator& triangulator, WorkerPool& pool, Surface& out,
             FilterCounts& counts);

 private:
  std::size_t fill_columns(const std::vector<GridVertex>& vertices);
  float usual_sigma_px(const std::vector<GridVertex>& vertices);
  void finish(WorkerPool& pool, Surface& out) const;

  Rig rig_;
  int boundaries_, lines_, line_step_px_;
  SurfaceBuilderOptions options_;
  DepthSlope depth_slope_;
  ColumnGrid columns_;
  std::vector<std::int32_t> vertex_;  // [line][boundary]: the better vertex there, or -1
  RankedSample sigmas_px_;
  std::vector<Hole> holes_;
  GridLinks links_;
  DenseSampler dense_;
  std::vector<GridVertex> vertices_, pixels_;
  SurfaceScratch scratch_;
};

}  // namespace relievo
