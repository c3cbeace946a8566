// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries as columns over (line, boundary), and where on that grid one surface goes on. Depth says
// less: a boundary that jumps from one surface to another moves along its own light sheet, whose depth rises
// only by distance / baseline for each metre across the view, as on many a slanted surface. Columns tell: on
// a surface their differences change little from one to the next, at a depth step one of them stands out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/parallel.h"

namespace relievo {

/// [line][boundary], NaN where nothing was decoded, with a margin of two on all sides that holds nothing, so
/// that neighbours can be asked for without a test.
class ColumnGrid {
 public:
  static constexpr int kMargin = 2;
  static constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

  /// Empty; memory is reused.
  void reset(int boundaries, int lines) {
    boundaries_ = boundaries;
    lines_ = lines;
    columns_.assign(static_cast<std::size_t>(stride()) * static_cast<std::size_t>(lines + 2 * kMargin),
                    kNone);
  }
  int boundaries() const { return boundaries_; }
  int lines() const { return lines_; }
  std::ptrdiff_t stride() const { return boundaries_ + 2 * kMargin; }
  float* line(int l) { return columns_.data() + (l + kMargin) * stride() + kMargin; }
  const float* line(int l) const { return columns_.data() + (l + kMargin) * stride() + kMargin; }

 private:
  int boundaries_ = 0;
  int lines_ = 0;
  std::vector<float> columns_;
};

/// What is known of the columns as a whole.
struct ColumnScale {
  int line_step_px = 1;  // rows of the camera from line to line
  float noise_px = 0;    // usual standard deviation of a column
};

/// Whether one surface goes on from x[1] to x[2], both of them `gap` grid places apart, by their difference
/// and those before (x[0] to x[1]) and behind (x[2] to x[3]), each of one place. NaN: not there, and nothing
/// speaks against. Columns rise from boundary to boundary.
bool surface_goes_on_across(const std::array<float, 4>& x, float gap, const ColumnScale& scale);
/// The same from line to line.
bool surface_goes_on_along(const std::array<float, 4>& x, float gap, const ColumnScale& scale);

/// [line][boundary], without margin.
struct GridLinks {
  std::vector<std::uint8_t> across;  // 1: the surface goes on to the next boundary on the line
  std::vector<std::uint8_t> along;   // 1: to the same boundary on the next line
  std::size_t steps = 0;             // places where both are there and the surface does not go on
};
void find_links(const ColumnGrid& grid, const ColumnScale& scale, WorkerPool& pool, GridLinks& out);

struct Hole {
  std::uint16_t boundary;
  std::uint16_t line;
  float column_px;
};
/// Places with nothing between two of one surface that are at most `size` missing places apart, on the line
/// or along the boundary, whichever is nearer. Sets them in `grid`; `out` is overwritten.
void fill_holes(int size, const ColumnScale& scale, ColumnGrid& grid, std::vector<Hole>& out);

}  // namespace relievo
