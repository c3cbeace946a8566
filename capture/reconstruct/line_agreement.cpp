// SPDX-License-Identifier: Apache-2.0
// SequenceDecoder's second half: lines against those above and below them.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "capture/reconstruct/sequence.h"

namespace relievo {
namespace {

constexpr float kLean_px = 2.5F;           // how far a boundary moves from one line to the next
constexpr float kCompleteEvidence = 1.2F;  // gain for a boundary that a neighbouring line predicts

// Verdicts on a decoded edge.
constexpr std::uint8_t kStays = 0;
constexpr std::uint8_t kGoes = 1;
constexpr std::uint8_t kOpen = 2;  // what becomes of others decides

/// Whether an edge's boundary is the one behind that of the edge before it, of a line's from `first` to
/// `end`.
bool follows(const SequenceResult& result, std::uint32_t first, std::uint32_t end, std::uint32_t e) {
  return e > first && e < end && result.boundary[e - 1] >= 0 &&
         result.boundary[e] == result.boundary[e - 1] + 1;
}

}  // namespace

std::int32_t& SequenceDecoder::cell(int line, int boundary) {
  return grid_[static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_) +
               static_cast<std::size_t>(boundary)];
}

/// Whether a boundary follows on neither of those beside it on its line and shows nothing but the stripes in
/// which their surfaces end: what was decoded is where these meet, and the boundary may be elsewhere on the
/// line.
bool SequenceDecoder::is_meeting(const SequenceContext& context, int left, int own, int right) const {
  if (own == left + 1 || right == own + 1) return false;
  for (const SlideColours* slide : {&shown_slide(context), &other_slide(context)}) {
    const auto of = [&](int boundary) { return slide->colours[static_cast<std::size_t>(boundary)]; };
    if (of(left)[1] != of(own)[0] || of(own)[1] != of(right)[0]) return false;
  }
  return true;
}

/// Gives up boundaries that are meetings.
void SequenceDecoder::give_up_meetings(const EdgeImage& edges, int line, const SequenceContext& context,
                                       SequenceResult& out) const {
  int left = -1;
  std::int16_t* own = nullptr;
  for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
       e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const int right = out.boundary[e];
    if (right < 0) continue;
    if (left >= 0 && is_meeting(context, left, *own, right)) {
      *own = -1;
    } else if (own != nullptr) {
      left = *own;
    }
    own = &out.boundary[e];
  }
}

/// Puts a line's edges on the grid. Of several that are one boundary the clearest stays; but where one lies
/// between its neighbours in the sequence, and shows its colours better, one that has neither is a rim.
void SequenceDecoder::place_on_grid(const EdgeImage& edges, int line, const SequenceContext& context,
                                    SequenceResult& out) {
  std::fill_n(&cell(line, 0), boundaries_, -1);
  const std::uint32_t first = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  const auto neighbours = [&](std::uint32_t e) {
    return int{follows(out, first, end, e)} + int{follows(out, first, end, e + 1)};
  };
  const auto better = [&](std::uint32_t e, std::uint32_t than) {
    const Edge &a = edges.edges[e], &b = edges.edges[than];
    const int more = neighbours(e) - neighbours(than);
    const int boundary = out.boundary[e];
    if (std::abs(more) == 2 &&
        (more > 0) == (gain(a, beside_[e], context, boundary) > gain(b, beside_[than], context, boundary)))
      return more > 0;
    return a.slope > b.slope;
  };
  for (std::uint32_t e = first; e < end; ++e) {
    if (out.boundary[e] < 0) continue;
    std::int32_t& slot = cell(line, out.boundary[e]);
    if (slot >= 0 && !better(e, static_cast<std::uint32_t>(slot))) {
      out.boundary[e] = -1;
    } else {
      if (slot >= 0) out.boundary[static_cast<std::size_t>(slot)] = -1;
      slot = static_cast<std::int32_t>(e);
    }
  }
}

/// Whether an edge's boundary goes on at the same place on one of the two lines in `direction`. `left`: what
/// was given up does not count.
bool SequenceDecoder::goes_on(const EdgeImage& edges, int line, std::uint32_t e, int boundary, int direction,
                              bool left) {
  for (const int d : {direction, 2 * direction}) {
    if (line + d < 0 || line + d >= edges.lines) continue;
    const std::int32_t other = cell(line + d, boundary);
    if (other < 0 || (left && verdict_[static_cast<std::size_t>(other)] == kGoes)) continue;
    const float off = edges.edges[static_cast<std::size_t>(other)].column_px - edges.edges[e].column_px;
    if (std::fabs(off) <= kLean_px * static_cast<float>(std::abs(d))) return true;
  }
  return false;
}

/// A boundary stays where a neighbour on the grid agrees with it: above, below, left or right. That is asked
/// from the first line to the last, and along each, so that of what is above and to the left only what is
/// left of it counts. Most edges stay or go whatever becomes of those; the others wait for them.
void SequenceDecoder::check(const EdgeImage& edges, const SequenceContext& context, WorkerPool& pool,
                            SequenceResult& out) {
  grid_.resize(static_cast<std::size_t>(edges.lines) * static_cast<std::size_t>(boundaries_));
  verdict_.resize(edges.edges.size());
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      if (context.other != nullptr) give_up_meetings(edges, line, context, out);
      place_on_grid(edges, line, context, out);
    }
  });
  for (Scratch& s : scratch_) s.open.clear();  // a worker without a line leaves its own as it was
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      const std::uint32_t first = edges.line_start[static_cast<std::size_t>(line)];
      const std::uint32_t last = edges.line_start[static_cast<std::size_t>(line) + 1];
      for (std::uint32_t e = first; e < last; ++e) {
        const int b = out.boundary[e];
        if (b < 0) continue;
        verdict_[e] = kGoes;
        if (convincing_[e] == 0) continue;
        const bool below = goes_on(edges, line, e, b, 1, false);
        const bool right = follows(out, first, last, e + 1);
        const bool before = follows(out, first, last, e);
        if (below) {
          verdict_[e] = kStays;
        } else if (goes_on(edges, line, e, b, -1, false) || (right && before)) {
          verdict_[e] = kOpen;
          scratch.open.push_back({line, e, before, right});
        }
      }
    }
  });
  for (const Scratch& scratch : scratch_) {
    for (const Open& o : scratch.open) {
      const bool above = goes_on(edges, o.line, o.edge, out.boundary[o.edge], -1, true);
      const bool both = o.right && o.left && verdict_[o.edge - 1] == kStays;
      verdict_[o.edge] = above || both ? kStays : kGoes;
    }
  }
  for (Scratch& s : scratch_) {
    s.unsupported = 0;
    s.open.clear();  // now those without a boundary
  }
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        std::int16_t& boundary = out.boundary[e];
        if (boundary >= 0 && verdict_[e] == kGoes) {
          cell(line, boundary) = -1;
          boundary = -1;
          ++scratch.unsupported;
        }
        if (boundary < 0) scratch.open.push_back({line, e, false, false});
      }
    }
  });
  without_.clear();
  for (const Scratch& scratch : scratch_) {
    out.counts.unsupported += scratch.unsupported;
    without_.insert(without_.end(), scratch.open.begin(), scratch.open.end());
  }
}

/// Whether it would be a meeting if edge `e` were that boundary.
bool SequenceDecoder::would_meet(const EdgeImage& edges, int line, std::uint32_t e,
                                 const SequenceContext& context, int boundary,
                                 const SequenceResult& result) const {
  std::uint32_t left = e;
  std::uint32_t right = e + 1;
  const std::uint32_t first = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  while (left > first && result.boundary[left - 1] < 0) --left;
  while (right < end && result.boundary[right] < 0) ++right;
  return left > first && right < end &&
         is_meeting(context, result.boundary[left - 1], boundary, result.boundary[right]);
}

/// What a line did not decode, its neighbours predict.
void SequenceDecoder::complete(const EdgeImage& edges, const SequenceContext& context, SequenceResult& out) {
  const auto predict = [&](const Open& o, int from) {
    if (from < 0 || from >= edges.lines || out.boundary[o.edge] >= 0) return;
    const Edge& edge = edges.edges[o.edge];
    const auto all = edges.edges.begin();
    const auto last = all + edges.line_start[static_cast<std::size_t>(from) + 1];
    auto n = std::lower_bound(all + edges.line_start[static_cast<std::size_t>(from)], last,
                              edge.column_px - kLean_px,
                              [](const Edge& other, float column_px) { return other.column_px < column_px; });
    float nearest = kLean_px;
    int best = -1;
    for (; n != last && n->column_px <= edge.column_px + kLean_px; ++n) {
      const int b = out.boundary[static_cast<std::size_t>(n - all)];
      if (b < 0 || cell(o.line, b) >= 0) continue;
      const float distance = std::fabs(n->column_px - edge.column_px);
      if (distance > nearest) continue;
      if (gain(edge, beside_[o.edge], context, b) < kCompleteEvidence) continue;
      if (unconfirmed(edges, o.line, o.edge, context, b)) continue;
      nearest = distance;
      best = b;
    }
    if (best < 0) return;
    if (context.other != nullptr && would_meet(edges, o.line, o.edge, context, best, out)) return;
    out.boundary[o.edge] = static_cast<std::int16_t>(best);
    cell(o.line, best) = static_cast<std::int32_t>(o.edge);
    ++out.counts.completed;
  };
  for (const Open& o : without_) predict(o, o.line - 1);
  // From the last line to the first, but along each from the left.
  for (std::size_t end = without_.size(); end > 0;) {
    std::size_t begin = end - 1;
    while (begin > 0 && without_[begin - 1].line == without_[begin].line) --begin;
    for (std::size_t i = begin; i < end; ++i) predict(without_[i], without_[i].line + 1);
    end = begin;
  }
}

}  // namespace relievo
