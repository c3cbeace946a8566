// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/uncovered.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace relievo {
namespace {

constexpr float kStands_px = 0.1F;  // less from one frame to the next, and it stands still,
constexpr float kSure_px = 0.2F;    // what is less sure of its place is not remembered
constexpr int kLooksEvery = 8;      // lines
constexpr float kStood_px = 0.3F;   // from where it was last seen to stand, and it still does
constexpr float kElsewhere = 2.F;   // pitches: it was on what has moved away
constexpr int kStandsLines = 4;     // so far around what comes back it is asked what stands
constexpr float kSameLook = 0.12F;  // Backdrop::difference of what is back
constexpr float kSameEdge_px = 0.3F;
constexpr float kRoom_px = 2.F;       // no other edge so near to what comes back
constexpr float kRestored_px = 0.1F;  // its standard deviation

bool known(float x) {
  return x == x;
}

/// The nearest edge, if there is one within kRoom_px.
std::optional<std::uint32_t> edge_near(const EdgeImage& edges, int line, float column_px) {
  std::optional<std::uint32_t> out;
  float nearest = kRoom_px;
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const float apart = std::fabs(edges.edges[e].column_px - column_px);
    if (apart > nearest) continue;
    nearest = apart;
    out = e;
  }
  return out;
}

}  // namespace

Uncovered::Uncovered(int boundaries, int lines)
    : backdrop_(boundaries, lines),
      boundaries_(boundaries),
      lines_(lines),
      uncovered_(static_cast<std::size_t>(boundaries) * static_cast<std::size_t>(lines)) {}

void Uncovered::begin(float pitch_px) {
  pitch_px_ = pitch_px;
  ++frame_;
}

/// Whether more boundaries around a place are where they were last seen to stand than a little beside it: a
/// surface that turns looks the same for a while, and is not where it was.
bool Uncovered::stands_around(int line, int boundary, float column_px, const ColumnGrid& now) const {
  int stood = 0;
  int moved = 0;
  for (int l = std::max(0, line - kStandsLines); l <= std::min(lines_ - 1, line + kStandsLines); ++l) {
    const float* there = now.line(l);
    for (int b = std::max(0, boundary - 1); b <= std::min(boundaries_ - 1, boundary + 1); ++b) {
      const float was = backdrop_.column_px(l, b);
      const float since = std::fabs(there[b] - was);
      if (!(std::fabs(was - column_px) < kElsewhere * pitch_px_ && since < kElsewhere * pitch_px_)) continue;
      ++(since < kStood_px ? stood : moved);
    }
  }
  return stood >= moved;
}

void Uncovered::find(const SlideFieldView& view, int line, const ColumnGrid& now, const MovingCells& moving) {
  const float* here = now.line(line);
  std::uint8_t* uncovered = uncovered_.data() + static_cast<std::ptrdiff_t>(line) * boundaries_;
  for (int b = 0; b < boundaries_; ++b) {
    const float column = backdrop_.column_px(line, b);
    uncovered[b] = !known(here[b]) && known(column) && moving.moves(line, column) &&
                   backdrop_.difference(view, line, b, column).value_or(1) < kSameLook &&
                   stands_around(line, b, column, now);
  }
}

void Uncovered::remember(const SlideFieldView& view, int line, const EdgeImage& edges,
                         const SequenceResult& result, const ColumnGrid& before) {
  // Under one slide, then under the other; all lines at first.
  if (frame_ >= 2 * kLooksEvery && line % kLooksEvery != frame_ / 2 % kLooksEvery) return;
  const float* was = before.line(line);
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0) continue;
    const float column = edges.edges[e].column_px;
    if (edges.edges[e].sigma_px > kSure_px) continue;
    if (result.still[e] == 0 && !(std::fabs(was[b] - column) < kStands_px)) continue;
    backdrop_.remember(view, line, b, column);
  }
}

std::size_t Uncovered::restore(int line, const EdgeImage& edges, ColumnGrid& now, SequenceResult& result,
                               std::vector<RecoveredBoundary>& restored) const {
  float* here = now.line(line);
  const std::uint8_t* uncovered = uncovered_.data() + static_cast<std::ptrdiff_t>(line) * boundaries_;
  std::size_t count = 0;
  for (int b = 0; b < boundaries_; ++b) {
    if (uncovered[b] == 0) continue;
    const float column = backdrop_.column_px(line, b);
    const std::optional<std::uint32_t> near = edge_near(edges, line, column);
    if (near && std::fabs(edges.edges[*near].column_px - column) < kSameEdge_px) {
      if (result.boundary[*near] >= 0) here[result.boundary[*near]] = kNoColumn;
      result.boundary[*near] = static_cast<std::int16_t>(b);
      here[b] = edges.edges[*near].column_px;
    } else if (near && result.boundary[*near] >= 0) {
      continue;
    } else {
      here[b] = column;
      restored.push_back({line, b, column, kRestored_px, 0});
    }
    ++count;
  }
  return count;
}

}  // namespace relievo
