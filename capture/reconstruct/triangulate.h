// SPDX-License-Identifier: Apache-2.0
// From a boundary seen at a camera pixel to a point in space: the camera's ray against the light sheet of the
// projected boundary (paper 5.4), with the lens distortion of both.
#pragma once

#include <optional>
#include <vector>

#include "base/frame3d.h"
#include "base/lens.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/triangulate_rows.h"

namespace relievo {

/// Precomputed for one rig, pattern and line spacing; immutable, so any number of threads may share it.
class Triangulator {
 public:
  Triangulator(const Rig& rig, const Pattern& pattern, int lines, int line_step_px);

  /// The point, in metres in the camera's frame, of pattern boundary `boundary` seen at `column_px` on
  /// `line`. Nothing where ray and sheet do not meet in front of both camera and projector.
  std::optional<Vec3f> point(int boundary, int line, float column_px) const {
    return point(boundary, 0, line, column_px);
  }

  /// The same for a projector column between two boundaries: `beyond` stripes to the right of `boundary`.
  /// `boundary` + 1 must be one too unless `beyond` is 0.
  std::optional<Vec3f> point(int boundary, float beyond, int line, float column_px) const {
    Vec3f out;
    if (!find(boundary, beyond, line, column_px, out)) return std::nullopt;
    return out;
  }

  /// As point(), into `out`, which stays as it is where it returns false.
  bool find(int boundary, float beyond, int line, float column_px, Vec3f& out) const;

  /// The points of all boundaries of a line of `grid`; what has none is taken off it.
  PointCounts place_line(int line, DecodedGrid& grid) const;

 private:
  std::array<float, 2> ray(int line, float column_px) const;
  double sheet(int boundary, double y) const;

  int ray_samples_;                         // a line
  std::vector<std::array<float, 2>> rays_;  // [line][every kRayStep columns]: x/z, y/z of the camera's ray
  int sheet_samples_;
  double sheet_first_, sheet_step_;  // y/z of the first sample, and between samples
  std::vector<float> sheets_;        // [boundary][sample], padded: x/z in the projector's frame
  bool straight_sheets_;             // no projector distortion: the first sample holds for all
  std::array<double, 9> rotation_;
  std::array<double, 3> translation_;
};

}  // namespace relievo
