// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/moving_places.h"

#include <algorithm>

namespace relievo {
namespace {

constexpr int kCellsAround = 8;
constexpr int kLinesAround = 2;
constexpr float kMuch = 0.03F;  // of all boundaries

}  // namespace

void MovingPlaces::reset(int width, int lines) {
  lines_ = lines;
  cells_ = width / kCell_px + 1;
  around_.assign(static_cast<std::size_t>(lines) * static_cast<std::size_t>(cells_), 0);
}

void MovingPlaces::add(int line, float column_px) {
  const int cell = static_cast<int>(column_px) / kCell_px;
  const int first = std::clamp(cell - kCellsAround, 0, cells_ - 1);
  const int last = std::clamp(cell + kCellsAround, 0, cells_ - 1);
  for (int l = std::max(0, line - kLinesAround); l <= std::min(lines_ - 1, line + kLinesAround); ++l)
    for (int c = first; c <= last; ++c) {
      std::uint8_t& count = around_[static_cast<std::size_t>(l * cells_ + c)];
      count = std::min<std::uint8_t>(count + 1, kMost);
    }
}

void MovingPlaces::find(int width, const SequenceResult& result, const EdgeImage& edges) {
  reset(width, edges.lines);
  std::size_t decoded = 0;
  std::size_t moving = 0;
  for (int line = 0; line < edges.lines; ++line) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      if (result.boundary[e] < 0) continue;
      ++decoded;
      if (result.still[e] != 0) continue;
      ++moving;
      add(line, edges.edges[e].column_px);
    }
  }
  much_ = static_cast<float>(moving) > kMuch * static_cast<float>(decoded);
}

void MovingPlaces::find(int width, ConsistencyCheck& checked, const PlaceGrid& places) {
  reset(width, places.lines());
  for (int line = 0; line < places.lines(); ++line) {
    const Place* here = places.line(line);
    const std::uint8_t* marks = checked.row(line).marks;
    for (int b = 0; b < places.boundaries(); ++b)
      if (here[b].known() && !(marks[b] & BoundaryRow::kStill)) add(line, here[b].column_px);
  }
}

}  // namespace relievo
