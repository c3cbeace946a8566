// SPDX-License-Identifier: Apache-2.0
// A printed board as a simulated camera sees it.
#pragma once

#include <vector>

#include "capture/calibrate/board.h"

namespace relievo {

/// The board on white paper, flush with a grey wall. Immutable: any thread.
class BoardSurface {
 public:
  explicit BoardSurface(const Board& board);

  /// Albedo at a point of the board's plane, averaged over a square that reaches `soft_m` to either side, as
  /// a lens that resolves a pixel shows it: sharper edges would alias.
  double albedo(double x_m, double y_m, double soft_m) const;

 private:
  double sum(double x, double y) const;

  Board board_;
  int width_ = 0, height_ = 0;  // of the print, pixels
  double pixels_per_m_ = 0;
  std::vector<double> integral_;  // of the print's albedo: (width + 1) x (height + 1)
};

}  // namespace relievo
