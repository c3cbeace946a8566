// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_place.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "capture/reconstruct/moving_places.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMoves = MovingPlaces::kMost;  // boundaries around that were elsewhere: fewer may be noise
constexpr int kMeanOf = 1;                   // lines to each side, which are off alike
constexpr float kDrawn = 4;  // times its standard deviation an edge is off where something moves

}  // namespace

void FieldPlacer::fill(const SequenceResult& result, const EdgeImage& edges) {
  edge_.assign(static_cast<std::size_t>(edges.lines) * static_cast<std::size_t>(boundaries_), -1);
  for (int line = 0; line < edges.lines; ++line)
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
      if (result.boundary[e] >= 0)
        edge_[static_cast<std::size_t>(line * boundaries_ + result.boundary[e])] =
            static_cast<std::int32_t>(e);
}

void FieldPlacer::look_at_line(const SlideFieldView& view, int line, const SequenceResult& result,
                               const EdgeImage& edges) {
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    seen_[e].off_px = kNone;
    const int b = result.boundary[e];
    const float column = edges.edges[e].column_px;
    if (b < 0 || view.moving->around(line, column) < kMoves) continue;
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
  fill(result, edges);
  seen_.resize(edges.edges.size());
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) look_at_line(view, line, result, edges);
  });
  pool.for_ranges(lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) weigh_line(line, lines, result, edges);
  });
}

}  // namespace relievo
