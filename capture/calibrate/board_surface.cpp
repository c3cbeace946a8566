// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board_surface.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr double kWhite = 0.85, kBlack = 0.08, kWall = 0.25;  // albedo
constexpr int kSquarePx = 48;                                 // of the print
constexpr int kMarginPx = 72;                                 // of white paper around the squares

}  // namespace

BoardSurface::BoardSurface(const Board& board) : board_(board), pixels_per_m_(kSquarePx / board.square_m) {
  const Image8 squares = draw_board(board, kSquarePx);
  width_ = squares.width() + 2 * kMarginPx;
  height_ = squares.height() + 2 * kMarginPx;
  const std::size_t stride = static_cast<std::size_t>(width_) + 1;
  integral_.assign(stride * (static_cast<std::size_t>(height_) + 1), 0);
  for (int y = 0; y < height_; ++y) {
    double line = 0;
    const int sy = y - kMarginPx;
    for (int x = 0; x < width_; ++x) {
      const int sx = x - kMarginPx;
      const bool inside = sx >= 0 && sy >= 0 && sx < squares.width() && sy < squares.height();
      line += inside && squares.row(sy)[sx] == 0 ? kBlack : kWhite;
      const std::size_t at = static_cast<std::size_t>(y + 1) * stride + static_cast<std::size_t>(x) + 1;
      integral_[at] = integral_[at - stride] + line;
    }
  }
}

/// Of the print's albedo left of x and above y; bilinear between pixels.
double BoardSurface::sum(double x, double y) const {
  x = std::clamp(x, 0.0, static_cast<double>(width_));
  y = std::clamp(y, 0.0, static_cast<double>(height_));
  const int left = std::min(static_cast<int>(x), width_ - 1),
            top = std::min(static_cast<int>(y), height_ - 1);
  const double u = x - left, v = y - top;
  const std::size_t stride = static_cast<std::size_t>(width_) + 1;
  const double* p = &integral_[static_cast<std::size_t>(top) * stride + static_cast<std::size_t>(left)];
  return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[stride] + u * p[stride + 1]);
}

double BoardSurface::albedo(double x_m, double y_m, double soft_m) const {
  const double x = x_m * pixels_per_m_ + kSquarePx + kMarginPx,
               y = y_m * pixels_per_m_ + kSquarePx + kMarginPx;
  const double soft = std::max(soft_m * pixels_per_m_, 0.5);
  const double left = x - soft, right = x + soft, top = y - soft, bottom = y + soft;
  const double printed = sum(right, bottom) - sum(left, bottom) - sum(right, top) + sum(left, top);
  const auto overlap = [](double from, double to, double end) {
    return std::max(0.0, std::min(to, end) - std::max(from, 0.0));
  };
  const double area = 4 * soft * soft;
  const double on_print = overlap(left, right, width_) * overlap(top, bottom, height_);
  return (printed + (area - on_print) * kWall) / area;
}

}  // namespace relievo
