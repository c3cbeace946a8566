// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/instant.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::infinity();
constexpr double kPhase = 0.25;       // of a frame, between its time stamp and where fields balance
constexpr double kFrames = 3;         // frames before older than this tell nothing
constexpr float kWorst_px = 0.3F;     // standard deviation of a place that tells how it moves
constexpr float kStill_px = 0.15F;    // less motion than this needs no neighbour that moves alike
constexpr float kAlike_px = 0.3F;     // between a boundary's motion and a neighbour's,
constexpr float kAlikeShare = 0.15F;  // and of the motion more
constexpr float kOffFields_px = 3.F;  // between it and what the fields of the frame tell
constexpr float kFastest_px = 16.F;   // from one frame to the next
constexpr float kFields = 2.F;        // of a frame
constexpr float kHalfWay = 0.5F;      // of the motion between the fields
constexpr float kMotion_px = 0.4F;    // standard deviation of that

}  // namespace

InstantFilter::InstantFilter(int boundaries, int lines, double frame_ns)
    : boundaries_(boundaries),
      lines_(lines),
      frame_ns_(frame_ns),
      stride_(static_cast<std::size_t>(boundaries) + 2),
      now_(stride_ * static_cast<std::size_t>(lines + 2), Seen{0, kNone}),
      before_(now_) {}

InstantFilter::Seen* InstantFilter::row(std::vector<Seen>& grid, int line) const {
  return grid.data() + static_cast<std::size_t>(line + 1) * stride_ + 1;
}

void InstantFilter::fill(const SequenceResult& result, const EdgeImage& edges,
                         const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool) {
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      Seen* here = row(now_, line);
      std::fill_n(here, boundaries_, Seen{0, kNone});
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        const Edge& edge = edges.edges[e];
        if (result.boundary[e] >= 0) here[result.boundary[e]] = {edge.column_px, edge.sigma_px};
      }
    }
  });
  for (const RecoveredBoundary& r : recovered) row(now_, r.line)[r.boundary] = {r.column_px, r.sigma_px};
}

/// False where the frame before tells nothing.
bool InstantFilter::adjust_by_before(int line, int boundary, const Step& step, float& column_px,
                                     float& sigma_px) {
  const Seen now = row(now_, line)[boundary];
  const Seen before = row(before_, line)[boundary];
  if (!(now.sigma_px < kWorst_px) || !(before.sigma_px < kWorst_px)) return false;
  const float moved = now.column_px - before.column_px;
  const float size = std::fabs(moved);
  if (!(size < kFastest_px)) return false;
  if (size > kStill_px) {
    // A boundary that lay on another surface came by another way than what is there now.
    if (std::fabs(moved - step.expected_px) > kOffFields_px) return false;
    // A code that was wrong moves alone.
    int alike = 0;
    for (const auto& [l, b] :
         {std::pair{line - 1, boundary}, {line + 1, boundary}, {line, boundary - 1}, {line, boundary + 1}}) {
      const Seen n = row(now_, l)[b];
      const Seen p = row(before_, l)[b];
      if (n.sigma_px == kNone || p.sigma_px == kNone) continue;
      alike += std::fabs(n.column_px - p.column_px - moved) < kAlike_px + kAlikeShare * size;
    }
    if (alike < 2) return false;
  }
  column_px -= step.share * moved;
  const float kept = (1 - step.share) * now.sigma_px;
  const float added = step.share * before.sigma_px;
  sigma_px = std::sqrt(kept * kept + added * added);
  return true;
}

void InstantFilter::adjust(const FrameInstant& frame, const SequenceResult& result, EdgeImage& edges,
                           std::vector<RecoveredBoundary>& recovered, WorkerPool& pool) {
  fill(result, edges, recovered, pool);
  const double frames = static_cast<double>(frame.time_ns - before_ns_) / frame_ns_;
  const bool by_before = have_before_ && frames > 0.5 && frames < kFrames + 0.5;
  const auto share = static_cast<float>(by_before ? kPhase / frames : 0);
  const auto adjust_one = [&](int line, int boundary, float& column_px, float& sigma_px) {
    const float moved = frame.motion.at(line, column_px);
    const Step step{share, kFields * static_cast<float>(frames) * moved};
    if (by_before && adjust_by_before(line, boundary, step, column_px, sigma_px)) return;
    if (moved == 0) return;
    column_px -= kHalfWay * moved;
    sigma_px = std::hypot(sigma_px, kHalfWay * kMotion_px);
  };
  if (by_before || !frame.motion.moves.empty()) {
    pool.for_shares(edges.line_start, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line) {
        for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
             e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
          Edge& edge = edges.edges[e];
          if (result.boundary[e] >= 0) adjust_one(line, result.boundary[e], edge.column_px, edge.sigma_px);
        }
      }
    });
    for (RecoveredBoundary& r : recovered) adjust_one(r.line, r.boundary, r.column_px, r.sigma_px);
  }
  std::swap(now_, before_);
  before_ns_ = frame.time_ns;
  have_before_ = true;
}

}  // namespace relievo
