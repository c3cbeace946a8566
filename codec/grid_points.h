// SPDX-License-Identifier: Apache-2.0
// From columns back to a surface: each camera ray is met with the light sheet of its boundary (paper 5.4), as
// the reconstruction did. codec/FORMAT.md, "From the grid to a surface".
#pragma once

#include <cstdint>
#include <vector>

#include "base/frame3d.h"
#include "base/result.h"
#include "codec/point_kernels.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// What can be worked out once for a calibration; lines and boundaries when they are first needed. One
/// thread.
class GridPoints {
 public:
  explicit GridPoints(const GridCalibration& calibration);

  const GridCalibration& calibration() const { return calibration_; }

  /// Fills positions, texture coordinates, grid, triangles and, where the grid has them, standard deviations
  /// and marks of interpolation of `out`; its memory is reused. Vertices come by line, then boundary: second
  /// places, whose line is the grid's, last. Triangles on copies of first places are on those. Fails
  /// where a ray meets no sheet in front of both camera and projector.
  Status to_surface(const StripeGrid& grid, Surface& out);

 private:
  struct Line {  // of one line, a value a boundary, rounded up to 8
    std::vector<float> column, ray_x, ray_y, slope, z;
  };
  /// `line`: of the picture.
  bool find_rays(const std::int32_t* columns, float step_px, int line, std::size_t count);
  bool meet_curved_sheets(const std::int32_t* columns);
  /// `index`: of the vertex at each boundary, one more at the end.
  bool make_line(const StripeGrid& grid, int line, Surface& out, const std::int32_t* index);
  void join_copies(Surface& out) const;
  void tell_quality(const StripeGrid& grid, int line, Surface& out, std::size_t first) const;

  GridCalibration calibration_;
  GridPointKernels kernels_ = all_grid_point_kernels().back();
  bool straight_rays_, straight_sheets_;
  int ray_samples_;
  std::vector<float> rays_x_, rays_y_;  // [line][every kRayStep columns], where the line is known
  std::vector<std::uint8_t> line_known_;
  std::vector<float> sheets_;  // [boundary][sample], where the boundary is known
  std::vector<std::uint8_t> sheet_known_;
  double sheet_first_ = 0, sheet_step_ = 0;
  // Of straight sheets: z = numerator / (a x + b y + c).
  std::vector<float> sheet_numerator_, sheet_a_, sheet_b_, sheet_c_;
  Line line_;
  std::vector<std::int32_t> index_[2];
};

}  // namespace relievo
