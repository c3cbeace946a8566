// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/instant.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "capture/reconstruct/consistency_rows.h"

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

InstantFilter::ByTime InstantFilter::by_time(std::int64_t time_ns) const {
  const double frames = static_cast<double>(time_ns - before_ns_) / frame_ns_;
  const bool before = have_before_ && frames > 0.5 && frames < kFrames + 0.5;
  return {frames, before, static_cast<float>(before ? kPhase / frames : 0)};
}

void InstantFilter::adjust_one(const ByTime& by, const FieldMotion& motion, int line, int boundary,
                               float& column_px, float& sigma_px) {
  const float moved = motion.at(line, column_px);
  const Step step{by.share, kFields * static_cast<float>(by.frames) * moved};
  if (by.before && adjust_by_before(line, boundary, step, column_px, sigma_px)) return;
  if (moved == 0) return;
  column_px -= kHalfWay * moved;
  sigma_px = std::hypot(sigma_px, kHalfWay * kMotion_px);
}

void InstantFilter::end_frame(std::int64_t time_ns) {
  std::swap(now_, before_);
  before_ns_ = time_ns;
  have_before_ = true;
}

void InstantFilter::adjust(const FrameInstant& frame, const SequenceResult& result, EdgeImage& edges,
                           std::vector<RecoveredBoundary>& recovered, WorkerPool& pool) {
  fill(result, edges, recovered, pool);
  const ByTime by = by_time(frame.time_ns);
  if (by.before || !frame.motion.moves.empty()) {
    pool.for_shares(edges.line_start, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line) {
        for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
             e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
          Edge& edge = edges.edges[e];
          if (result.boundary[e] >= 0)
            adjust_one(by, frame.motion, line, result.boundary[e], edge.column_px, edge.sigma_px);
        }
      }
    });
    for (RecoveredBoundary& r : recovered)
      adjust_one(by, frame.motion, r.line, r.boundary, r.column_px, r.sigma_px);
  }
  end_frame(frame.time_ns);
}

void InstantFilter::adjust(std::int64_t time_ns, ConsistencyCheck& checked, WorkerPool& pool,
                           PlaceGrid& out) {
  constexpr int kMargin = ConsistencyCheck::kMargin;
  const auto stride = checked.stride();
  const std::size_t cells = stride * static_cast<std::size_t>(lines_ + 2 * kMargin);
  if (before_px_.size() != cells) {
    before_px_.assign(cells, kNoColumn);
    before_sigma_px_.assign(cells, 0);
  }
  const auto row = [&](std::vector<float>& grid, int line) {
    return grid.data() + static_cast<std::size_t>(line + kMargin) * stride + kMargin;
  };
  moved_.resize(static_cast<std::size_t>(pool.workers()));
  for (auto& own : moved_) own.resize(2 * stride);
  if (out.boundaries() != boundaries_ || out.lines() != lines_) out.reset(boundaries_, lines_, {});
  const ByTime by = by_time(time_ns);
  const InstantRules rules{.share = by.share,
                           .worst_px = by.before ? kWorst_px : 0,
                           .still_px = kStill_px,
                           .alike_px = kAlike_px,
                           .alike_share = kAlikeShare,
                           .furthest_px = kOffFields_px};
  pool.for_ranges(lines_, [&](int begin, int end, int worker) {
    float* column_px = moved_[static_cast<std::size_t>(worker)].data();
    float* sigma_px = column_px + stride;
    for (int line = begin; line < end; ++line) {
      const auto beside = [&](const auto& of) { return ColumnRows{of(line - 1), of(line), of(line + 1)}; };
      consistency_kernels().to_instant({beside([&](int l) { return checked.settled_px(l); }),
                                        beside([&](int l) { return row(before_px_, l); }),
                                        checked.row(line).sigma_px, row(before_sigma_px_, line)},
                                       boundaries_, rules, column_px, sigma_px);
      Place* to = out.line(line);
      for (int b = 0; b < boundaries_; ++b) to[b] = {column_px[b], sigma_px[b]};
    }
  });
  pool.for_ranges(lines_, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      std::copy_n(checked.settled_px(line), boundaries_, row(before_px_, line));
      std::copy_n(checked.row(line).sigma_px, boundaries_, row(before_sigma_px_, line));
    }
  });
  before_ns_ = time_ns;
  have_before_ = true;
}

}  // namespace relievo
