// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/continuity.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "capture/reconstruct/neighbours.h"

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 3;
constexpr float kNear_px = 0.5F;   // between an edge and where the boundary is expected
constexpr float kApart_px = 0.5F;  // between a boundary's motion and its neighbours'
constexpr float kPlain = 0.05F;    // contrast that is none
constexpr float kLean_px = 1.F;    // between lines, of a boundary that goes on
constexpr int kLeastKnown = 3;     // neighbours that tell how the surface moved
constexpr float kSigma_px = 0.1F;  // of a place that is half expectation, at least
constexpr float kExpected = 0.5F;  // share of the expectation in it

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

/// Gives up boundaries at the ends of surfaces that moved unlike their neighbours: another surface's or a
/// step's own edge, decoded in this one's order. Only those of the line itself change.
std::size_t Continuity::drop_line(int line, SequenceResult& result, const EdgeImage& edges) const {
  const float* now = row(now_, line);
  const float* before = row(before_, line);
  std::size_t dropped = 0;
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int b = result.boundary[e];
    if (b < 0 || !known(before[b])) continue;
    const float moved_px = now[b] - before[b];
    if (std::fabs(moved_px) < kApart_px && edges.edges[e].contrast < kPlain) continue;
    const bool inside = known(now[b - 1]) && known(now[b + 1]) && known(row(now_, line - 1)[b]) &&
                        known(row(now_, line + 1)[b]);
    if (inside) continue;
    const Motion around = motion(line, b);
    if (around.neighbours < kLeastKnown || std::fabs(moved_px - around.px) < kApart_px) continue;
    if (result.still[e] != 0) result.doubted[e] = result.boundary[e];
    result.boundary[e] = -1;
    ++dropped;
  }
  return dropped;
}

std::size_t Continuity::carry_line(int line, SequenceResult& result, EdgeImage& edges) const {
  const float* now = row(now_, line);
  const float* before = row(before_, line);
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  std::size_t carried = 0;
  for (int b = 0; b < boundaries_; ++b) {
    if (known(now[b]) || !known(before[b])) continue;
    const auto goes_on = [&](float column_px) {
      for (const int lines : {-2, -1, 1, 2})
        if (std::fabs(row(now_, line + lines)[b] - column_px) <
            kLean_px * static_cast<float>(std::abs(lines)))
          return true;
      return false;
    };
    const Motion moved = motion(line, b);
    if (moved.neighbours < kLeastKnown) continue;
    const float expected_px = before[b] + moved.px;
    float nearest_px = kNear_px;
    std::uint32_t best = end;
    for (std::uint32_t e = begin; e < end; ++e) {
      const float off = std::fabs(edges.edges[e].column_px - expected_px);
      if (result.boundary[e] >= 0 || off > nearest_px) continue;
      nearest_px = off;
      best = e;
    }
    if (best == end || !goes_on(edges.edges[best].column_px)) continue;
    Edge& edge = edges.edges[best];
    result.boundary[best] = static_cast<std::int16_t>(b);
    edge.column_px += kExpected * (expected_px - edge.column_px);
    edge.sigma_px = std::max(edge.sigma_px, kSigma_px);
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
  counts_.assign(static_cast<std::size_t>(pool.threads()), {});
  if (have_before_) {
    pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
      ContinuityCounts& counts = counts_[static_cast<std::size_t>(worker)];
      for (int line = begin; line < end; ++line) {
        counts.rejected += drop_line(line, result, edges);
        counts.carried += carry_line(line, result, edges);
      }
    });
  }
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
