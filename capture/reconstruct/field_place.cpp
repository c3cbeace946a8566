// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_place.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kCell_px = 4;      // in which motion is told,
constexpr int kCellsAround = 4;  // and around a boundary that moved,
constexpr int kLinesAround = 2;
constexpr std::uint8_t kMoved = 6;  // so many: something moves. One alone may be a track that was lost
constexpr int kMeanOf = 1;          // lines to each side, which are off alike
constexpr float kDrawn = 4;         // times its standard deviation an edge is off where something moves

}  // namespace

void FieldPlacer::find_moving(int lines, int width, const SequenceResult& result, const EdgeImage& edges) {
  cells_ = width / kCell_px + 1;
  moving_.assign(static_cast<std::size_t>(lines) * static_cast<std::size_t>(cells_), 0);
  edge_.assign(static_cast<std::size_t>(lines) * static_cast<std::size_t>(boundaries_), -1);
  for (int line = 0; line < lines; ++line) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      const int b = result.boundary[e];
      if (b < 0) continue;
      edge_[static_cast<std::size_t>(line * boundaries_ + b)] = static_cast<std::int32_t>(e);
      if (result.still[e] != 0) continue;
      const int cell = static_cast<int>(edges.edges[e].column_px) / kCell_px;
      const int first = std::clamp(cell - kCellsAround, 0, cells_ - 1);
      const int last = std::clamp(cell + kCellsAround, 0, cells_ - 1);
      for (int l = std::max(0, line - kLinesAround); l <= std::min(lines - 1, line + kLinesAround); ++l)
        for (int c = first; c <= last; ++c) {
          std::uint8_t& count = moving_[static_cast<std::size_t>(l * cells_ + c)];
          count = std::min<std::uint8_t>(count + 1, kMoved);
        }
    }
  }
}

void FieldPlacer::look_at_line(const SlideFieldView& view, int line, const SequenceResult& result,
                               const EdgeImage& edges) {
  const std::uint8_t* moving = moving_.data() + static_cast<std::size_t>(line * cells_);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    seen_[e].off_px = kNone;
    const int b = result.boundary[e];
    const float column = edges.edges[e].column_px;
    if (b < 0 || moving[std::clamp(static_cast<int>(column) / kCell_px, 0, cells_ - 1)] < kMoved) continue;
    const auto room = [&](int next) {
      if (next < 0 || next >= boundaries_ || row(line)[next] < 0) return StepFinder::kOpen_px;
      const float there = edges.edges[static_cast<std::size_t>(row(line)[next])].column_px;
      return std::clamp(std::fabs(there - column), StepFinder::kLeastRoom_px, StepFinder::kOpen_px);
    };
    const auto place = steps_.balance(view, line, b, column, room(b - 1), room(b + 1));
    if (place) seen_[e] = {place->column_px - column, place->sigma_px};
  }
}

void FieldPlacer::weigh_line(int line, int lines, const SequenceResult& result, EdgeImage& edges) const {
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    if (std::isnan(seen_[e].off_px)) continue;
    float sum = 0;
    float weights = 0;
    for (int l = std::max(0, line - kMeanOf); l <= std::min(lines - 1, line + kMeanOf); ++l) {
      const std::int32_t there = row(l)[result.boundary[e]];
      if (there < 0) continue;
      const Seen& seen = seen_[static_cast<std::size_t>(there)];
      if (std::isnan(seen.off_px)) continue;
      const float weight = 1 / (seen.sigma_px * seen.sigma_px);
      sum += weight * seen.off_px;
      weights += weight;
    }
    Edge& edge = edges.edges[e];
    const float drawn = kDrawn * edge.sigma_px;
    const float both = std::hypot(drawn, seen_[e].sigma_px);
    edge.column_px += drawn * drawn / (both * both) * sum / weights;
    edge.sigma_px = drawn * seen_[e].sigma_px / both;
  }
}

void FieldPlacer::place(const SlideFieldView& view, const SequenceResult& result, WorkerPool& pool,
                        EdgeImage& edges) {
  const int lines = std::min(edges.lines, view.field.height);
  find_moving(lines, view.field.width, result, edges);
  seen_.resize(edges.edges.size());
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) look_at_line(view, line, result, edges);
  });
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) weigh_line(line, lines, result, edges);
  });
}

}  // namespace relievo
