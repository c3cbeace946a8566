// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/continuity.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <utility>

#include "capture/reconstruct/neighbours.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 3;
constexpr float kNear_px = 0.5F;      // between an edge and where the boundary is expected
constexpr float kApart_px = 0.5F;     // between a boundary's motion and its neighbours'
constexpr float kLean_px = 1.F;       // between lines, of a boundary that goes on
constexpr int kLeastKnown = 3;        // neighbours that tell how the surface moved
constexpr float kSigma_px = 0.1F;     // of a place that is half expectation, at least
constexpr float kUnknown_px = 0.15F;  // where its own standard deviation was not told
constexpr float kExpected = 0.5F;     // share of the expectation in it

bool known(float x) {
  return x == x;
}

}  // namespace

Continuity::Continuity(int boundaries, int lines)
    : boundaries_(boundaries),
      lines_(lines),
      stride_(static_cast<std::size_t>(boundaries) + 2 * kMargin),
      now_(stride_ * static_cast<std::size_t>(lines + 2 * kMargin), kNone),
      before_(now_) {}

float* Continuity::row(std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}
const float* Continuity::row(const std::vector<float>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}

/// Median of how far a place's neighbours moved since the frame before.
Continuity::Motion Continuity::motion(int line, int boundary) const {
  auto [moved, count] = neighbours_went([&](int lines, int boundaries) {
    return row(now_, line + lines)[boundary + boundaries] - row(before_, line + lines)[boundary + boundaries];
  });
  if (count == 0) return {0, 0};
  const auto middle = moved.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(moved.begin(), middle, moved.begin() + static_cast<std::ptrdiff_t>(count));
  return {*middle, static_cast<int>(count)};
}

/// True at the end of a surface that moved unlike its neighbours: another surface's or a step's own edge,
/// decoded in this one's order. `plain`: the scene has no contrast there.
bool Continuity::moved_alone(int line, int b, bool plain) const {
  const float* now = row(now_, line);
  const float* before = row(before_, line);
  if (!known(before[b])) return false;
  const float moved_px = now[b] - before[b];
  if (std::fabs(moved_px) < kApart_px && plain) return false;
  const bool inside = known(now[b - 1]) && known(now[b + 1]) && known(row(now_, line - 1)[b]) &&
                      known(row(now_, line + 1)[b]);
  if (inside) return false;
  const Motion around = motion(line, b);
  return around.neighbours >= kLeastKnown && !(std::fabs(moved_px - around.px) < kApart_px);
}

/// Gives up what moved alone. Only boundaries of the line itself change.
std::size_t Continuity::drop_line(int line, SequenceResult& result, const EdgeImage& edges) const {
  std::size_t dropped = 0;
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0 || !moved_alone(line, b, edges.edges[e].contrast < BoundaryRow::kPlainContrast)) continue;
    if (result.still[e] != 0) result.doubted[e] = result.boundary[e];
    result.boundary[e] = -1;
    ++dropped;
  }
  return dropped;
}

/// Where a boundary that only the frame before has would be now; nothing where the surface's motion is not
/// known.
std::optional<float> Continuity::expected_px(int line, int boundary) const {
  const float before = row(before_, line)[boundary];
  if (known(row(now_, line)[boundary]) || !known(before)) return std::nullopt;
  const Motion moved = motion(line, boundary);
  if (moved.neighbours < kLeastKnown) return std::nullopt;
  return before + moved.px;
}

bool Continuity::goes_on(int line, int boundary, float column_px) const {
  for (const int lines : {-2, -1, 1, 2})
    if (std::fabs(row(now_, line + lines)[boundary] - column_px) <
        kLean_px * static_cast<float>(std::abs(lines)))
      return true;
  return false;
}

std::size_t Continuity::carry_line(int line, SequenceResult& result, EdgeImage& edges) const {
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  std::size_t carried = 0;
  for (int b = 0; b < boundaries_; ++b) {
    const std::optional<float> expected = expected_px(line, b);
    if (!expected) continue;
    float nearest_px = kNear_px;
    std::uint32_t best = end;
    for (std::uint32_t e = begin; e < end; ++e) {
      const float off = std::fabs(edges.edges[e].column_px - *expected);
      if (result.boundary[e] >= 0 || off > nearest_px) continue;
      nearest_px = off;
      best = e;
    }
    if (best == end || !goes_on(line, b, edges.edges[best].column_px)) continue;
    Edge& edge = edges.edges[best];
    result.boundary[best] = static_cast<std::int16_t>(b);
    edge.column_px += kExpected * (*expected - edge.column_px);
    edge.sigma_px = std::max(edge.sigma_px, kSigma_px);
    ++carried;
  }
  return carried;
}

std::size_t Continuity::carry_line(int line, const QuickLine& edges, ConsistencyCheck& checked) const {
  float* column_px = checked.settled_px(line);
  const BoundaryRow found = checked.row(line);
  std::size_t carried = 0;
  for (int b = 0; b < boundaries_; ++b) {
    const std::optional<float> expected = expected_px(line, b);
    if (!expected) continue;
    float nearest_px = kNear_px;
    int best = -1;
    const QuickEdge* last = edges.edges + edges.count;
    for (const QuickEdge *e =
             std::lower_bound(edges.edges, last, *expected - kNear_px,
                              [](const QuickEdge&one, float px) { return one.column_px < px; });
         e != last && e->column_px <= *expected + kNear_px; ++e) {
      const auto i = static_cast<int>(e - edges.edges);
      const float off = std::fabs(e->column_px - *expected);
      const bool taken = edges.boundary[i] >= 0 && (edges.boundary[i] != b || known(column_px[b]));
      if (taken || off > nearest_px) continue;
      nearest_px = off;
      best = i;
    }
    if (best < 0 || !goes_on(line, b, edges.edges[best].column_px)) continue;
    // What was given up as this very boundary has its own place and standard deviation there.
    const bool own = edges.boundary[best] == b && known(found.column_px[b]);
    const float own_px = own ? found.column_px[b] : edges.edges[best].column_px;
    column_px[b] = own_px + kExpected * (*expected - own_px);
    found.sigma_px[b] = own ? std::max(found.sigma_px[b], kSigma_px) : kUnknown_px;
    if (!own) found.marks[b] = edges.still[best] != 0 ? BoundaryRow::kStill : 0;
    ++carried;
  }
  return carried;
}

ContinuityCounts Continuity::check(const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool,
                                   SequenceResult& result, EdgeImage& edges) {
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      float* now = row(now_, line);
      std::fill_n(now, boundaries_, kNone);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
        if (result.boundary[e] >= 0) now[result.boundary[e]] = edges.edges[e].column_px;
    }
  });
  for (const RecoveredBoundary& r : recovered) row(now_, r.line)[r.boundary] = r.column_px;
  counts_.assign(static_cast<std::size_t>(pool.workers()), {});
  if (have_before_) {
    pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
      ContinuityCounts& counts = counts_[static_cast<std::size_t>(worker)];
      for (int line = begin; line < end; ++line) {
        counts.rejected += drop_line(line, result, edges);
        counts.carried += carry_line(line, result, edges);
      }
    });
  }
  return end_frame();
}

ContinuityCounts Continuity::check(QuickSequence& sequence, ConsistencyCheck& checked, WorkerPool& pool) {
  counts_.assign(static_cast<std::size_t>(pool.workers()), {});
  pool.for_ranges(lines_, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line)
      std::copy_n(checked.settled_px(line), boundaries_, row(now_, line));
  });
  if (have_before_) {
    pool.for_ranges(lines_, [&](int begin, int end, int worker) {
      ContinuityCounts& counts = counts_[static_cast<std::size_t>(worker)];
      for (int line = begin; line < end; ++line) {
        const std::uint8_t* marks = checked.row(line).marks;
        const float* now = row(now_, line);
        for (int b = 0; b < boundaries_; ++b) {
          if (!known(now[b]) || !moved_alone(line, b, marks[b] & BoundaryRow::kPlain)) continue;
          checked.settled_px(line)[b] = kNone;
          ++counts.rejected;
        }
        counts.carried += carry_line(line, sequence.line(line), checked);
      }
    });
  }
  return end_frame();
}

ContinuityCounts Continuity::end_frame() {
  // What was carried is no evidence for the frame after, and what was dropped may have been right.
  std::swap(now_, before_);
  have_before_ = true;
  ContinuityCounts total;
  for (const ContinuityCounts& c : counts_) {
    total.rejected += c.rejected;
    total.carried += c.carried;
  }
  return total;
}

}  // namespace relievo
