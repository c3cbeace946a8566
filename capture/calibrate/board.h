// SPDX-License-Identifier: Apache-2.0
// The flat target of a geometric calibration.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

using Vec2d = std::array<double, 2>;

/// A chessboard: inner corners across and down, and the side of a square.
struct Board {
  int columns = 0;
  int rows = 0;
  double square_m = 0;

  int corners() const { return columns * rows; }
  /// Corner i, row by row, on the board's plane z = 0, metres.
  Vec2d corner_m(int i) const { return {square_m * (i % columns), square_m * (i / columns)}; }
};

/// "chessboard:9x7:75mm": inner corners and the square's side in mm, cm or m.
Result<Board> parse_board(const std::string& text);

/// The board's corners in a grey picture of any range, row by row, pixels; sub-pixel. Nothing where the whole
/// board is not seen.
std::optional<std::vector<Vec2d>> find_board(const ImageF& grey, const Board& board);

}  // namespace relievo
