// SPDX-License-Identifier: Apache-2.0
// The flat target of a geometric calibration: a chessboard, or a ChArUco board, whose white squares carry
// markers that tell the corners apart, so that a part of it is enough.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

using Vec2d = std::array<double, 2>;

/// Inner corners across and down, and the side of a square. There is one more square than corners each way.
struct Board {
  int columns = 0;
  int rows = 0;
  double square_m = 0;
  double marker_m = 0;     // ChArUco: side of a marker; 0 where it is a plain chessboard
  std::string dictionary;  // ChArUco: OpenCV's name of it, e.g. "DICT_4X4_50"

  bool charuco() const { return marker_m > 0; }
  int corners() const { return columns * rows; }
  /// Corner i, row by row, on the board's plane z = 0, metres.
  Vec2d corner_m(int i) const { return {square_m * (i % columns), square_m * (i / columns)}; }
};

/// One corner as the camera sees it.
struct BoardCorner {
  int index = 0;  // 0..corners() - 1
  Vec2d camera_px{};
};

/// "chessboard:9x7:75mm": inner corners and the square's side in mm, cm or m.
/// "charuco:10x8:30mm:22mm[:DICT]": squares, their side, the markers' side and dictionary ("5X5_100";
/// "4X4_50" where not given), as OpenCV and most board generators count. Errors say what is wrong with
/// `text`.
Result<Board> parse_board(const std::string& text);

/// The board's corners in a grey picture of any range, by index, sub-pixel. Of a chessboard all or none; of a
/// ChArUco board those beside markers that were read.
std::vector<BoardCorner> find_board(const ImageF& grey, const Board& board);

/// The squares, without a margin, one channel, 0 or 255: the first square is black, `square_px` a side.
Image8 draw_board(const Board& board, int square_px);

}  // namespace relievo
