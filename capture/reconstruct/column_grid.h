// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries as columns over (line, boundary), and where on that grid one surface goes on. Depth says
// less: a boundary that jumps from one surface to another moves along its own light sheet, whose depth rises
// only by distance / baseline for each metre across the view, as on many a slanted surface. Columns tell: on
// a surface their differences change little from one to the next, at a depth step one of them stands out.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/margin_grid.h"

namespace relievo {

/// kNoColumn where nothing was decoded.
using ColumnGrid = MarginGrid<float, 2>;

/// What is known of the columns as a whole.
struct ColumnScale {
  int line_step_px = 1;  // rows of the camera from line to line
  float noise_px = 0;    // usual standard deviation of a column
};

/// How far a difference of columns may lie outside those of its neighbours, in pixels. At a crease it lies
/// between them.
struct ColumnLimits {
  static constexpr float kAcrossShare = 0.15F;  // of the difference more, where both neighbours are known
  static constexpr float kAcrossOpen = 0.35F;   // the same where only one is
  static constexpr float kWidest_px = 64.F;     // across, where none is

  explicit ColumnLimits(const ColumnScale& scale);
  float across, along;
  float lean;  // along, where no neighbour is known
};

/// Whether one surface goes on from x[1] to x[2], both of them `gap` grid places apart, by their difference
/// and those before (x[0] to x[1]) and behind (x[2] to x[3]), each of one place. NaN: not there, and nothing
/// speaks against. Columns rise from boundary to boundary.
bool surface_goes_on_across(const std::array<float, 4>& x, float gap, const ColumnScale& scale);
/// The same from line to line.
bool surface_goes_on_along(const std::array<float, 4>& x, float gap, const ColumnScale& scale);

/// Share of a bend, from one difference of columns to the next, with which a surface is taken to go on.
inline constexpr float kBendGoesOn = 0.7F;

/// Where a surface goes on to beside its column x0, with x1 next to that and x2 next to x1: straight where x2
/// is NaN.
inline float goes_on_to(float x0, float x1, float x2) {
  const float bend = x0 - 2 * x1 + x2;
  return 2 * x0 - x1 + (bend == bend ? kBendGoesOn * bend : 0);
}

struct Foretold {
  float column_px;
  float unsure_px;  // more than where the surface goes on
};

inline Foretold foretold(const std::array<float, 3>& x) {
  return {goes_on_to(x[0], x[1], x[2]), 0};
}

/// The same of columns known to a standard deviation each, beside the end of a surface. It ends there because
/// it turns away, sooner than a bend tells: of simulated faces and spheres, the last column is .3 to .5 px
/// short of what three before it foretell wherever these draw nearer to each other at all.
inline Foretold ends_on(const std::array<float, 3>& x, const std::array<float, 3>& sigma_px) {
  constexpr float kShort_px = 0.4F;
  constexpr float kUnsure_px = 0.3F;
  constexpr float kUnsureWider_px = 0.7F;  // where they draw apart
  constexpr float kNoise = 2;              // standard deviations of a bend that is none,
  constexpr float kBent_px = 0.1F;         // and so much more one that is
  const float bend = x[0] - 2 * x[1] + x[2];
  const float noise =
      std::sqrt(sigma_px[0] * sigma_px[0] + 4 * sigma_px[1] * sigma_px[1] + sigma_px[2] * sigma_px[2]);
  const float bent = std::clamp((std::fabs(bend) - kNoise * noise) / kBent_px, 0.F, 1.F);
  const float outwards = x[0] > x[1] ? 1.F : -1.F;
  const float column = goes_on_to(x[0], x[1], x[2]);
  if (bend * outwards > 0) return {column, kUnsureWider_px * bent};
  return {column - outwards * kShort_px * bent, kUnsure_px * bent};
}

struct Hole {
  std::uint16_t boundary;
  std::uint16_t line;
  float column_px;
};
/// Places with nothing between two of one surface that are at most `size` missing places apart, on the line
/// or along the boundary, whichever is nearer. `out` is overwritten.
void find_holes(int size, const ColumnScale& scale, const DecodedGrid& grid, std::vector<Hole>& out);

}  // namespace relievo
