// SPDX-License-Identifier: Apache-2.0
// A frame's decoded boundaries on the grid of stripes and lines, and the points that they are: planes of
// rows, so that all that follows decoding works on whole rows at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "capture/reconstruct/margin_grid.h"

namespace relievo {

/// What was decoded of a line: kNoColumn where nothing was, and then the other two tell nothing.
struct DecodedRow {
  float *column_px, *sigma_px, *slope;
};

/// Where points are; NaN where there is none.
struct PointRow {
  float *x, *y, *z;  // metres, camera frame
};

/// Lines and places, of which each holds a boundary of the pattern (or, of a dense surface, a pixel). Around
/// them are kMargin lines and places at least that hold nothing, and rows can be read, and written but for
/// the margin, in eights from place 0 on. Different lines may be used by different threads.
class DecodedGrid {
 public:
  static constexpr int kMargin = 3;

  /// Nothing anywhere; memory is reused.
  void reset(int boundaries, int lines);
  int boundaries() const { return boundaries_; }
  int lines() const { return lines_; }
  /// Cells from a line's plane to the next of the same line; places that rows hold beyond `boundaries`, too.
  std::size_t stride() const { return stride_; }

  /// Nothing on a line: what is put on it comes next.
  void start_line(int line);
  /// A boundary seen at `column_px` with standard deviation `sigma_px` (0: not known). Of two at one place
  /// that of the greater `slope` stays; the column settles a tie, so that their order never does. False where
  /// there were two.
  bool put(int line, int boundary, float column_px, float sigma_px, float slope) {
    float& column = row(line, kColumn)[boundary];
    float& best = row(line, kSlope)[boundary];
    const bool taken = column == column;
    if (taken && (slope != best ? slope < best : column_px >= column)) return false;
    column = column_px;
    row(line, kSigma)[boundary] = sigma_px;
    best = slope;
    return !taken;
  }

  /// kNoColumn: nowhere. The other planes tell nothing there.
  float* column_px(int line) { return row(line, kColumn); }
  const float* column_px(int line) const { return row(line, kColumn); }
  const float* sigma_px(int line) const { return row(line, kSigma); }
  const float* slope(int line) const { return row(line, kSlope); }
  /// To be written as a whole, instead of start_line() and put().
  DecodedRow decoded(int line) { return {row(line, kColumn), row(line, kSigma), row(line, kSlope)}; }
  PointRow points(int line) { return {row(line, kX), row(line, kY), row(line, kZ)}; }
  const float* x(int line) const { return row(line, kX); }
  const float* y(int line) const { return row(line, kY); }
  const float* z(int line) const { return row(line, kZ); }

  /// Which places were not measured, but lie between measured ones of one surface: 1. Null where all were.
  const std::uint8_t* interpolated(int line) const {
    return interpolated_.empty() ? nullptr : interpolated_.data() + interpolated_row(line);
  }
  /// From now on such places are told apart; none is, yet.
  void start_interpolated();
  /// After start_interpolated().
  std::uint8_t* interpolated_of(int line) { return interpolated_.data() + interpolated_row(line); }

 private:
  enum Plane { kColumn, kSigma, kSlope, kX, kY, kZ, kPlanes };
  static constexpr std::size_t kLeft = 8;    // cells of margin, so that place 0 stays where vectors begin
  static constexpr std::size_t kRight = 16;  // beyond the last eight

  float* row(int line, Plane plane) { return cells_.data() + first_of(line, plane); }
  const float* row(int line, Plane plane) const { return cells_.data() + first_of(line, plane); }
  std::size_t first_of(int line, Plane plane) const {
    return (static_cast<std::size_t>(line + kMargin) * kPlanes + plane) * stride_ + kLeft;
  }
  std::size_t interpolated_row(int line) const { return static_cast<std::size_t>(line) * stride_; }

  int boundaries_ = 0;
  int lines_ = 0;
  std::size_t stride_ = 0;
  std::vector<float> cells_;                // [line, with margin][plane][place, with margin]
  std::vector<std::uint8_t> interpolated_;  // [line][place, padded], or empty
};

}  // namespace relievo
