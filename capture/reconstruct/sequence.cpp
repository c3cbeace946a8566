// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/sequence.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

// Gains of the path search. Evidence of one side is a colour's agreement with three channels, -1..1; a clear
// edge of a still scene has 2 from its own frame and 2 from the other slide's.
constexpr GainRules kGains{
    .transition_slack = 0.9F,  // of the best pair of colours: further off is no candidate
    .other_floor = -0.6F,      // what the other slide's frame can take away: the scene may have moved
    .contradiction = 0.0F,     // but where it held still, a side that disagrees
    .contradicted = 1.5F,      // costs this much more
    .threshold = 1.3F,         // an edge that gains less is better left out
};
constexpr OrderRules kOrder{
    .in_order = 1.0F,     // bonus for the boundary that follows in the sequence
    .per_missing = 0.5F,  // less for each boundary missed in between
    .max_missing = 3,
};
constexpr float kJump = -1.6F;       // a depth step: anything may follow
constexpr float kUnexpected = 1.0F;  // less for a boundary where no depth seen before would put it
constexpr int kMaxSkipped = 3;       // false edges between two that follow each other
constexpr float kClear = 0.5F;       // of a channel's evidence: leaves no doubt about its sign
constexpr float kNoStripe = -100;    // agreement with what no stripe is

// How far an edge may have moved in two frames: 1 m/s in depth is 10 px where a stripe is 8 wide.
constexpr float kSearch_px = 14;
constexpr float kSearchStep_px = 2;

// What a decoded edge must show by itself, whatever its neighbours are.
constexpr float kLeastSide = 0.4F;  // of agreement on each side: no channel may clearly disagree
constexpr float kLeastOwn = 1.1F;   // of both sides
constexpr float kLeastGain = 2.0F;  // with the other slide's frame, where the scene held still

// Lines above and below.
constexpr float kLean_px = 2.5F;           // how far a boundary moves from one line to the next
constexpr float kCompleteEvidence = 1.2F;  // gain for a boundary that a neighbouring line predicts

float agreement(Primary colour, const SideEvidence& e) {
  return ((colour & 1 ? e[0] : -e[0]) + (colour & 2 ? e[1] : -e[1]) + (colour & 4 ? e[2] : -e[2])) *
         (1.F / 3);
}

/// Of every primary.
PerPrimary agreements(const SideEvidence& e) {
  PerPrimary out;
  for (std::size_t c = 0; c < 8; ++c) out[c] = agreement(static_cast<Primary>(c), e);
  return out;
}

/// Where the edge stood two frames ago, under the same slide, from where it is now: the nearest place with
/// the same colours on both sides. `found` is false where there is none.
struct Displacement {
  bool found;
  float px;
};

bool alike(const SideEvidence& a, const SideEvidence& b) {
  const float dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const float size = std::fabs(a[0]) + std::fabs(a[1]) + std::fabs(a[2]);
  return dot > 0.5F * size;
}

Displacement displacement(const DifferenceImage& same, int line, const Edge& edge) {
  const auto matches = [&](float px) {
    const EvidenceBeside there = evidence_beside(same, line, edge, edge.column_px + px);
    return alike(edge.left, there.left) && alike(edge.right, there.right);
  };
  if (matches(0)) return {true, 0};
  for (float px = kSearchStep_px; px <= kSearch_px; px += kSearchStep_px) {
    if (matches(px)) return {true, px};
    if (matches(-px)) return {true, -px};
  }
  return {false, 0};
}

/// Gain from the other slide's frame, where the colours on the two sides agree with it by `left` and `right`.
float other_gain(float left, float right, bool tracked) {
  if (!tracked) return std::max(kGains.other_floor, left + right);
  return left + right - (std::min(left, right) < kGains.contradiction ? kGains.contradicted : 0);
}

}  // namespace

SequenceDecoder::SequenceDecoder(const Pattern& pattern) : boundaries_(pattern.boundaries()) {
  for (int s = 0; s < 2; ++s) {
    Slide& slide = slides_[static_cast<std::size_t>(s)];
    const int shown = std::min(s, pattern.slides - 1);
    const int other = std::min(1 - s, pattern.slides - 1);
    for (int b = 0; b < boundaries_; ++b) {
      const Primary left = pattern.colour(b, shown);
      const Primary right = pattern.colour(b + 1, shown);
      slide.colours.push_back({left, right});
      slide.table.add(left, right, pattern.colour(b, other), pattern.colour(b + 1, other));
    }
    slide.table.fill_up();
    slide.by_code.assign(8 * 8 * 8 * 8, -1);
    std::vector<int> uses(slide.by_code.size());
    for (int b = 0; b < boundaries_; ++b) {
      const auto i = static_cast<std::size_t>(b);
      const auto code = static_cast<std::size_t>(
          ((slide.table.left[i] * 8 + slide.table.right[i]) * 8 + slide.table.other_left[i]) * 8 +
          slide.table.other_right[i]);
      slide.by_code[code] = static_cast<std::int16_t>(++uses[code] == 1 ? b : -1);
    }
  }
}

EdgeAgreement SequenceDecoder::agreement_of(const Edge& edge, const Beside& beside) {
  EdgeAgreement out{agreements(edge.left), agreements(edge.right), agreements(beside.left),
                    agreements(beside.right), beside.tracked};
  for (PerPrimary* side : {&out.left, &out.right}) {  // no stripe is black or white
    side->front() = kNoStripe;
    side->back() = kNoStripe;
  }
  return out;
}

/// The boundary that an edge is beyond doubt, or -1: every channel on both sides in both frames is clear.
int SequenceDecoder::clear_boundary(const Edge& edge, const Beside& beside, const Slide& shown) {
  if (!beside.tracked) return -1;
  std::size_t code = 0;
  float least = kClear;
  for (const SideEvidence* side : {&edge.left, &edge.right, &beside.left, &beside.right}) {
    const SideEvidence& e = *side;
    code = code * 8 + static_cast<std::size_t>((e[0] > 0 ? 1 : 0) | (e[1] > 0 ? 2 : 0) | (e[2] > 0 ? 4 : 0));
    least = std::min({least, std::fabs(e[0]), std::fabs(e[1]), std::fabs(e[2])});
  }
  return least >= kClear ? shown.by_code[code] : -1;
}

void SequenceDecoder::decode_line(const EdgeImage& edges, int line, const SequenceContext& context,
                                  Scratch& scratch, SequenceResult& out) {
  constexpr int kPlaces = kPathCandidates;
  const PathKernels& kernels = path_kernels();
  const Slide& shown = shown_slide(context);
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  const int count = static_cast<int>(end - begin);
  PathCandidates& candidates = scratch.candidates;
  candidates.resize(static_cast<std::size_t>(count));
  float best_so_far = 0;
  std::int32_t best_end = -1;  // place at which the best path so far ends
  for (int e = 0; e < count; ++e) {
    const auto index = begin + static_cast<std::uint32_t>(e);
    const int own = e * kPlaces;
    const Edge& edge = edges.edges[index];
    std::int32_t* boundary = candidates.boundary.data() + own;
    float* gains = candidates.gain.data() + own;
    int& used = candidates.used[static_cast<std::size_t>(e)];
    if (const int clear = clear_boundary(edge, beside_[index], shown); clear >= 0) {
      used = 1;
      *boundary = clear;
      *gains = gain(edge, beside_[index], context, clear) - kGains.threshold;
    } else {
      used = kernels.choose(shown.table, agreement_of(edge, beside_[index]), kGains, boundary, gains);
      for (int i = 0; i < used && context.expected != nullptr; ++i) {
        const auto [low, high] = (*context.expected)[static_cast<std::size_t>(boundary[i])];
        if (edge.column_px < low || edge.column_px > high) gains[i] -= kUnexpected;
      }
    }
    const float jump_from = best_so_far + kJump;
    const bool jump = jump_from > 0;  // a path may start anywhere
    kernels.extend({.first = std::max(0, e - 1 - kMaxSkipped),
                    .edge = e,
                    .start = jump ? jump_from : 0,
                    .start_from = jump ? best_end : -1},
                   kOrder, candidates);
    for (std::int32_t a = own; a < own + used; ++a) {
      const float best = candidates.best[static_cast<std::size_t>(a)];
      best_end = best > best_so_far ? a : best_end;
      best_so_far = std::max(best, best_so_far);
    }
  }
  for (std::int32_t a = best_end; a >= 0; a = candidates.from[static_cast<std::size_t>(a)]) {
    const std::uint32_t index = begin + static_cast<std::uint32_t>(a / kPlaces);
    const std::int32_t boundary = candidates.boundary[static_cast<std::size_t>(a)];
    out.boundary[index] = static_cast<std::int16_t>(boundary);
    convincing_[index] = convincing(edges.edges[index], beside_[index], context, boundary);
    ++scratch.in_order;
  }
  scratch.score += best_so_far;
}

float SequenceDecoder::gain(const Edge& edge, const Beside& beside, const SequenceContext& context,
                            int boundary) const {
  const auto [l, r] = shown_slide(context).colours[static_cast<std::size_t>(boundary)];
  const auto [ol, orr] = other_slide(context).colours[static_cast<std::size_t>(boundary)];
  return agreement(l, edge.left) + agreement(r, edge.right) +
         other_gain(agreement(ol, beside.left), agreement(orr, beside.right), beside.tracked);
}

/// The colours themselves speak for the boundary, not its place in the order alone: a step's own edge beside
/// a true boundary gets the order's bonus as readily.
bool SequenceDecoder::convincing(const Edge& edge, const Beside& beside, const SequenceContext& context,
                                 int boundary) const {
  const auto [l, r] = shown_slide(context).colours[static_cast<std::size_t>(boundary)];
  const float left = agreement(l, edge.left);
  const float right = agreement(r, edge.right);
  return std::min(left, right) > kLeastSide && left + right > kLeastOwn &&
         (context.other == nullptr || !beside.tracked || gain(edge, beside, context, boundary) > kLeastGain);
}

float SequenceDecoder::other_agreement(const Edge& edge, int line, int boundary,
                                       const SequenceContext& context) const {
  if (context.other == nullptr) return 0;
  const auto [left, right] = other_slide(context).colours[static_cast<std::size_t>(boundary)];
  const EvidenceBeside beside = evidence_beside(*context.other, line, edge, edge.column_px);
  return std::min(agreement(left, beside.left), agreement(right, beside.right));
}

/// What the other slide's frame shows beside the edge: where it stood on the way between the frames around
/// that one.
SequenceDecoder::Beside SequenceDecoder::look_beside(const Edge& edge, int line,
                                                     const SequenceContext& context) {
  Beside out{{}, {}, true};
  float px = 0;
  if (context.same != nullptr) {
    const Displacement moved = displacement(*context.same, line, edge);
    out.tracked = moved.found && moved.px == 0;
    px = context.other_share * moved.px;
  }
  if (context.other == nullptr) return out;
  const EvidenceBeside there = evidence_beside(*context.other, line, edge, edge.column_px + px);
  out.left = there.left;
  out.right = there.right;
  return out;
}

void SequenceDecoder::check_and_complete(const EdgeImage& edges, const SequenceContext& context,
                                         SequenceResult& out) {
  const auto cell = [&](int line, int boundary) -> std::int32_t& {
    return grid_[static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_) +
                 static_cast<std::size_t>(boundary)];
  };
  grid_.assign(static_cast<std::size_t>(edges.lines) * static_cast<std::size_t>(boundaries_), -1);
  const auto edges_of = [&](int line) {
    return std::array{edges.line_start[static_cast<std::size_t>(line)],
                      edges.line_start[static_cast<std::size_t>(line) + 1]};
  };
  const auto column = [&](std::int32_t e) { return edges.edges[static_cast<std::size_t>(e)].column_px; };
  for (int line = 0; line < edges.lines; ++line) {
    const auto [begin, end] = edges_of(line);
    for (std::uint32_t e = begin; e < end; ++e) {
      if (out.boundary[e] < 0) continue;
      std::int32_t& slot = cell(line, out.boundary[e]);
      if (slot < 0 || edges.edges[e].slope > edges.edges[static_cast<std::size_t>(slot)].slope) {
        if (slot >= 0) out.boundary[static_cast<std::size_t>(slot)] = -1;
        slot = static_cast<std::int32_t>(e);
      } else {
        out.boundary[e] = -1;
      }
    }
  }

  // A boundary stays where a neighbour on the grid agrees with it: above, below, left or right.
  const auto near_above_or_below = [&](int line, int boundary, float x) {
    for (const int d : {-2, -1, 1, 2}) {
      if (line + d < 0 || line + d >= edges.lines) continue;
      const std::int32_t other = cell(line + d, boundary);
      if (other >= 0 && std::fabs(column(other) - x) <= kLean_px * static_cast<float>(std::abs(d)))
        return true;
    }
    return false;
  };
  for (int line = 0; line < edges.lines; ++line) {
    const auto [begin, end] = edges_of(line);
    for (std::uint32_t e = begin; e < end; ++e) {
      const int b = out.boundary[e];
      if (b < 0) continue;
      const float x = edges.edges[e].column_px;
      int support = near_above_or_below(line, b, x) ? 2 : 0;
      if (e > begin && b > 0 && out.boundary[e - 1] == b - 1) ++support;
      if (e + 1 < end && b + 1 < boundaries_ && out.boundary[e + 1] == b + 1) ++support;
      if (support >= 2 && convincing_[e] != 0) continue;
      cell(line, b) = -1;
      out.boundary[e] = -1;
      ++out.counts.unsupported;
    }
  }

  // What a line did not decode, its neighbours predict.
  const auto complete = [&](int line, int from) {
    if (from < 0 || from >= edges.lines) return;
    const auto [begin, end] = edges_of(line);
    const auto [other_begin, other_end] = edges_of(from);
    std::uint32_t k = other_begin;
    for (std::uint32_t e = begin; e < end; ++e) {
      if (out.boundary[e] >= 0) continue;
      const Edge& edge = edges.edges[e];
      while (k < other_end && edges.edges[k].column_px < edge.column_px - kLean_px) ++k;
      float nearest = kLean_px;
      int best = -1;
      for (std::uint32_t n = k; n < other_end && edges.edges[n].column_px <= edge.column_px + kLean_px; ++n) {
        const int b = out.boundary[n];
        if (b < 0 || cell(line, b) >= 0) continue;
        const float distance = std::fabs(edges.edges[n].column_px - edge.column_px);
        if (distance > nearest) continue;
        if (gain(edge, beside_[e], context, b) < kCompleteEvidence) continue;
        nearest = distance;
        best = b;
      }
      if (best < 0) continue;
      out.boundary[e] = static_cast<std::int16_t>(best);
      cell(line, best) = static_cast<std::int32_t>(e);
      ++out.counts.completed;
    }
  };
  for (int line = 1; line < edges.lines; ++line) complete(line, line - 1);
  for (int line = edges.lines - 2; line >= 0; --line) complete(line, line + 1);
}

void SequenceDecoder::decode(const EdgeImage& edges, const SequenceContext& context, WorkerPool& pool,
                             SequenceResult& out) {
  out.boundary.assign(edges.edges.size(), -1);
  out.counts = {};
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  for (Scratch& s : scratch_) {
    s.score = 0;
    s.in_order = 0;
  }
  beside_.resize(edges.edges.size());
  out.still.resize(edges.edges.size());
  convincing_.resize(edges.edges.size());
  pool.for_ranges(edges.lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        beside_[e] = look_beside(edges.edges[e], line, context);
        out.still[e] = beside_[e].tracked;
      }
      decode_line(edges, line, context, scratch_[static_cast<std::size_t>(worker)], out);
    }
  });
  out.score = 0;
  for (const Scratch& s : scratch_) {
    out.score += s.score;
    out.counts.in_order += s.in_order;
  }
  check_and_complete(edges, context, out);
}

bool same_slide(const DifferenceImage& a, const DifferenceImage& b) {
  constexpr int kEveryLine = 7;
  if (a.values.size() != b.values.size()) return false;
  const float threshold_a = 4 * a.noise + 1;
  const float threshold_b = 4 * b.noise + 1;
  std::uint32_t both = 0;
  std::uint32_t equal = 0;
  for (int line = 0; line < a.lines; line += kEveryLine) {
    const float* va = a.line(line);
    const float* vb = b.line(line);
    for (int i = 0; i < 3 * a.width; ++i) {
      const bool stand_out = (std::fabs(va[i]) >= threshold_a) & (std::fabs(vb[i]) >= threshold_b);
      both += stand_out;
      equal += stand_out & ((va[i] > 0) == (vb[i] > 0));
    }
  }
  // Channels of two slides agree about every second time; of the same slide, but for what moved, always.
  return both > 0 && std::uint64_t{equal} * 10 > std::uint64_t{both} * 8;
}

}  // namespace relievo
