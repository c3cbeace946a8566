// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/sequence.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace relievo {
namespace {

// Gains of the path search. Evidence of one side is a colour's agreement with three channels, -1..1; a clear
// edge of a still scene has 2 from its own frame and 2 from the other slide's.
constexpr float kTransitionSlack = 0.9F;  // of the best pair of colours: further off is no candidate
constexpr float kOtherSlideFloor =
    -0.6F;  // what the other slide's frame can take away: the scene may have moved
constexpr float kContradiction = 0.0F;  // but where it held still, a side that disagrees
constexpr float kContradicted = 1.5F;   // costs this much more
constexpr float kThreshold = 1.3F;      // an edge that gains less is better left out
constexpr float kInOrder = 1.0F;        // bonus for the boundary that follows in the sequence
constexpr float kPerMissing = 0.5F;     // less for each boundary missed in between
constexpr int kMaxMissing = 3;
constexpr float kJump = -1.6F;  // a depth step: anything may follow
constexpr int kMaxSkipped = 3;  // false edges between two that follow each other

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
using ColourAgreement = std::array<float, 8>;

ColourAgreement agreements(const SideEvidence& e) {
  ColourAgreement out;
  for (std::size_t c = 0; c < 8; ++c) out[c] = agreement(static_cast<Primary>(c), e);
  return out;
}

std::size_t best_colour(const ColourAgreement& of) {
  std::size_t best = 1;
  for (std::size_t c = 2; c < 7; ++c) best = of[c] > of[best] ? c : best;
  return best;
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
    return alike(edge.left, evidence_left(same, line, edge.column_px + px, edge.left_reach_px)) &&
           alike(edge.right, evidence_right(same, line, edge.column_px + px, edge.right_reach_px));
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
  if (!tracked) return std::max(kOtherSlideFloor, left + right);
  return left + right - (std::min(left, right) < kContradiction ? kContradicted : 0);
}

}  // namespace

SequenceDecoder::SequenceDecoder(const Pattern& pattern) : boundaries_(pattern.boundaries()) {
  for (int s = 0; s < 2; ++s) {
    Slide& slide = slides_[static_cast<std::size_t>(s)];
    for (int b = 0; b < boundaries_; ++b) {
      const int shown = std::min(s, pattern.slides - 1);
      const Primary left = pattern.colour(b, shown);
      const Primary right = pattern.colour(b + 1, shown);
      slide.colours.push_back({left, right});
      slide.by_transition[static_cast<std::size_t>(left * 8 + right)].push_back(static_cast<std::int16_t>(b));
    }
  }
}

void SequenceDecoder::find_candidates(const Edge& edge, const Beside& beside, const SequenceContext& context,
                                      Scratch& scratch) const {
  const Slide& shown = shown_slide(context);
  const Slide& other = other_slide(context);
  const ColourAgreement left = agreements(edge.left);
  const ColourAgreement right = agreements(edge.right);
  const ColourAgreement theirs_left = agreements(beside.left);
  const ColourAgreement theirs_right = agreements(beside.right);
  const std::size_t best_left = best_colour(left);
  const std::size_t best_right = best_colour(right);
  float best_pair = left[best_left] + right[best_right];
  if (shown.by_transition[best_left * 8 + best_right].empty()) {
    best_pair = -10;
    for (std::size_t l = 1; l < 7; ++l) {
      for (std::size_t r = 1; r < 7; ++r) {
        if (!shown.by_transition[l * 8 + r].empty()) best_pair = std::max(best_pair, left[l] + right[r]);
      }
    }
  }
  const float least = std::max(0.F, best_pair - kTransitionSlack);
  // The best of them, best first, in as many places as there are at most.
  std::array<Candidate, kCandidates> best;
  std::size_t count = 0;
  for (std::size_t l = 1; l < 7; ++l) {
    if (left[l] + right[best_right] < least) continue;
    for (std::size_t r = 1; r < 7; ++r) {
      const float own = left[l] + right[r];
      if (own < least) continue;
      for (const std::int16_t b : shown.by_transition[l * 8 + r]) {
        const auto [ocl, ocr] = other.colours[static_cast<std::size_t>(b)];
        const float gain = own + other_gain(theirs_left[ocl], theirs_right[ocr], beside.tracked) - kThreshold;
        const auto better = [&](const Candidate& than) {
          return gain != than.gain ? gain > than.gain : b < than.boundary;
        };
        std::size_t place = count;
        if (count < kCandidates) {
          ++count;
        } else if (!better(best[--place])) {
          continue;
        }
        for (; place > 0 && better(best[place - 1]); --place) best[place] = best[place - 1];
        best[place] = {b, gain, 0, -1, -1};
      }
    }
  }
  scratch.candidates.insert(scratch.candidates.end(), best.begin(),
                            best.begin() + static_cast<std::ptrdiff_t>(count));
}

void SequenceDecoder::decode_line(const EdgeImage& edges, int line, const SequenceContext& context,
                                  Scratch& scratch, SequenceResult& out) const {
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  const int count = static_cast<int>(end - begin);
  auto& candidates = scratch.candidates;
  candidates.clear();
  scratch.edge_begin.assign(1, 0);
  scratch.edge_of.clear();
  scratch.last.assign(static_cast<std::size_t>(boundaries_), -1);
  float best_so_far = 0;
  std::int32_t best_end = -1;  // candidate at which the best path so far ends
  for (int e = 0; e < count; ++e) {
    const auto index = begin + static_cast<std::uint32_t>(e);
    find_candidates(edges.edges[index], beside_[index], context, scratch);
    scratch.edge_begin.push_back(static_cast<std::int32_t>(candidates.size()));
    scratch.edge_of.resize(candidates.size(), e);
    const float jump_from = best_so_far + kJump;
    const std::int32_t jump_end = best_end;
    const std::int32_t own = scratch.edge_begin[static_cast<std::size_t>(e)];
    const std::int32_t reach = scratch.edge_begin[static_cast<std::size_t>(std::max(0, e - 1 - kMaxSkipped))];
    for (std::int32_t a = own; a < static_cast<std::int32_t>(candidates.size()); ++a) {
      Candidate& here = candidates[static_cast<std::size_t>(a)];
      float in_order = 0;
      std::int32_t in_order_from = -1;
      for (int missing = 0; missing <= kMaxMissing && here.boundary - 1 - missing >= 0; ++missing) {
        const auto before_boundary = static_cast<std::size_t>(here.boundary - 1 - missing);
        for (std::int32_t b = scratch.last[before_boundary]; b >= reach;
             b = candidates[static_cast<std::size_t>(b)].same) {
          const float value = candidates[static_cast<std::size_t>(b)].best + kInOrder -
                              kPerMissing * static_cast<float>(missing);
          // Of two that are as good the one further left, whatever the order of looking.
          if (value > in_order || (value == in_order && b < in_order_from)) {
            in_order = value;
            in_order_from = b;
          }
        }
      }
      float from = 0;  // a path may start anywhere
      here.from = -1;
      if (jump_from > from) {
        from = jump_from;
        here.from = jump_end;
      }
      if (in_order > from) {
        from = in_order;
        here.from = in_order_from;
      }
      here.best = from + here.gain;
    }
    for (std::int32_t a = own; a < static_cast<std::int32_t>(candidates.size()); ++a) {
      Candidate& here = candidates[static_cast<std::size_t>(a)];
      here.same = std::exchange(scratch.last[static_cast<std::size_t>(here.boundary)], a);
      if (here.best > best_so_far) {
        best_so_far = here.best;
        best_end = a;
      }
    }
  }
  for (std::int32_t a = best_end; a >= 0; a = candidates[static_cast<std::size_t>(a)].from) {
    out.boundary[begin + static_cast<std::uint32_t>(scratch.edge_of[static_cast<std::size_t>(a)])] =
        candidates[static_cast<std::size_t>(a)].boundary;
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

/// What the other slide's frame shows beside the edge: where it stood half way between the frames around that
/// one.
SequenceDecoder::Beside SequenceDecoder::look_beside(const Edge& edge, int line,
                                                     const SequenceContext& context) {
  Beside out{{}, {}, true};
  float px = 0;
  if (context.same != nullptr) {
    const Displacement moved = displacement(*context.same, line, edge);
    out.tracked = moved.found;
    px = 0.5F * moved.px;
  }
  if (context.other == nullptr) return out;
  out.left = evidence_left(*context.other, line, edge.column_px + px, edge.left_reach_px);
  out.right = evidence_right(*context.other, line, edge.column_px + px, edge.right_reach_px);
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
      if (support >= 2 && convincing(edges.edges[e], beside_[e], context, b)) continue;
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
  pool.for_ranges(edges.lines, [&](int begin, int end, int worker) {
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
        beside_[e] = look_beside(edges.edges[e], line, context);
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
  if (a.values.size() != b.values.size()) return false;
  const float threshold_a = 4 * a.noise + 1;
  const float threshold_b = 4 * b.noise + 1;
  std::size_t both = 0;
  std::size_t equal = 0;
  for (std::size_t i = 0; i < a.values.size(); i += 7) {
    if (std::fabs(a.values[i]) < threshold_a || std::fabs(b.values[i]) < threshold_b) continue;
    ++both;
    equal += (a.values[i] > 0) == (b.values[i] > 0);
  }
  // Channels of two slides agree about every second time; of the same slide, but for what moved, always.
  return both > 0 && equal * 10 > both * 8;
}

}  // namespace relievo
