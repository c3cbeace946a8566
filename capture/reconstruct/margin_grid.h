// SPDX-License-Identifier: Apache-2.0
// Something of each boundary on each line, with a margin around that holds nothing, so that neighbours can be
// asked for without a test.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace relievo {

/// A column where there is none. Compares unequal to itself.
inline constexpr float kNoColumn = std::numeric_limits<float>::quiet_NaN();

/// [line][boundary] of `Cell`s, `margin` more on all sides. One thread writes a line.
template <typename Cell, int margin>
class MarginGrid {
 public:
  static constexpr int kMargin = margin;

  /// All cells hold `nothing`; memory is reused.
  void reset(int boundaries, int lines, const Cell& nothing) {
    boundaries_ = boundaries;
    lines_ = lines;
    cells_.assign(static_cast<std::size_t>(stride() * (lines + 2 * kMargin)), nothing);
  }
  int boundaries() const { return boundaries_; }
  int lines() const { return lines_; }
  /// Cells from a line to the next.
  std::ptrdiff_t stride() const { return boundaries_ + 2 * kMargin; }
  /// Boundary 0 of a line. Those of the margin's lines can be asked for, too.
  Cell* line(int l) { return cells_.data() + first_of(l); }
  const Cell* line(int l) const { return cells_.data() + first_of(l); }

 private:
  std::ptrdiff_t first_of(int l) const { return (l + kMargin) * stride() + kMargin; }

  int boundaries_ = 0;
  int lines_ = 0;
  std::vector<Cell> cells_;
};

}  // namespace relievo
