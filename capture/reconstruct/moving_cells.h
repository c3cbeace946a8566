// SPDX-License-Identifier: Apache-2.0
// Near which places of a line an edge was elsewhere two frames ago.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace relievo {

/// Keeps its memory from frame to frame. Different lines may be written at once.
class MovingCells {
 public:
  /// Every line is to be cleared then.
  void resize(int width, int lines) {
    cells_ = width / kCell_px + 1;
    moving_.resize(static_cast<std::size_t>(lines * cells_));
  }
  void clear(int line) { std::fill_n(of(line), cells_, std::uint8_t{0}); }

  /// An edge that moves.
  void add(int line, float column_px) {
    const int cell = static_cast<int>(column_px) / kCell_px;
    const int first = std::clamp(cell - kCellsAround, 0, cells_ - 1);
    const int last = std::clamp(cell + kCellsAround, 0, cells_ - 1);
    std::fill(of(line) + first, of(line) + last + 1, std::uint8_t{1});
  }
  bool moves(int line, float column_px) const {
    const int cell = static_cast<int>(column_px) / kCell_px;
    return cell >= 0 && cell < cells_ && moving_[static_cast<std::size_t>(line * cells_ + cell)] != 0;
  }

 private:
  static constexpr int kCell_px = 4;
  static constexpr int kCellsAround = 3;

  std::uint8_t* of(int line) { return moving_.data() + static_cast<std::ptrdiff_t>(line) * cells_; }

  int cells_ = 0;                     // of a line
  std::vector<std::uint8_t> moving_;  // [line][cell]
};

}  // namespace relievo
