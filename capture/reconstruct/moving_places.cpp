// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/moving_places.h"

#include <algorithm>

namespace relievo {
namespace {

constexpr int kCellsAround = 8;
constexpr int kLinesAround = 2;

}  // namespace

void MovingPlaces::find(int width, const SequenceResult& result, const EdgeImage& edges) {
  cells_ = width / kCell_px + 1;
  around_.assign(static_cast<std::size_t>(edges.lines) * static_cast<std::size_t>(cells_), 0);
  for (int line = 0; line < edges.lines; ++line) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      if (result.boundary[e] < 0 || result.still[e] != 0) continue;
      const int cell = static_cast<int>(edges.edges[e].column_px) / kCell_px;
      const int first = std::clamp(cell - kCellsAround, 0, cells_ - 1);
      const int last = std::clamp(cell + kCellsAround, 0, cells_ - 1);
      for (int l = std::max(0, line - kLinesAround); l <= std::min(edges.lines - 1, line + kLinesAround); ++l)
        for (int c = first; c <= last; ++c) {
          std::uint8_t& count = around_[static_cast<std::size_t>(l * cells_ + c)];
          count = std::min<std::uint8_t>(count + 1, kMost);
        }
    }
  }
}

}  // namespace relievo
