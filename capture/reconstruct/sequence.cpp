// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/sequence.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "capture/reconstruct/sequence_rules.h"

namespace relievo {

using namespace sequence_rules;

namespace {

/// Of an edge that moved: what a channel of its own frame clearly contradicts (2/3) is no candidate.
constexpr GainRules kMovingGains = [] {
  GainRules gains = kGains;
  gains.transition_slack = 0.65F;
  return gains;
}();

/// Where the edge stood two frames ago, under the same slide, from where it is now: the nearest place with
/// the same colours on both sides. `found` is false where there is none.
struct Displacement {
  bool found;
  float px;
};

/// Where it is not where it was, but may have been `expected_px` from there.
Displacement displacement(const DifferenceImage& same, int line, const Edge& edge, float expected_px) {
  const auto matches = [&](float px) {
    const EvidenceBeside there = evidence_beside(same, line, edge, edge.column_px + px);
    return alike(edge.left, there.left) && alike(edge.right, there.right);
  };
  const bool moves = expected_px != 0;
  if (moves && matches(expected_px)) return {true, expected_px};
  const float furthest = moves ? kSearchMoving_px : kSearch_px;
  for (float px = kSearchStep_px; px <= furthest; px += kSearchStep_px) {
    if (matches(expected_px + px)) return {true, expected_px + px};
    if (matches(expected_px - px)) return {true, expected_px - px};
  }
  return {false, expected_px};
}

}  // namespace

std::array<SlideColours, 2> slide_colours(const Pattern& pattern) {
  std::array<SlideColours, 2> out;
  for (int s = 0; s < 2; ++s) {
    SlideColours& slide = out[static_cast<std::size_t>(s)];
    const int shown = std::min(s, pattern.slides - 1);
    const int other = std::min(1 - s, pattern.slides - 1);
    slide.by_code.assign(8 * 8 * 8 * 8, -1);
    std::vector<int> uses(slide.by_code.size());
    for (int b = 0; b < pattern.boundaries(); ++b) {
      const Primary left = pattern.colour(b, shown);
      const Primary right = pattern.colour(b + 1, shown);
      const Primary other_left = pattern.colour(b, other);
      const Primary other_right = pattern.colour(b + 1, other);
      slide.colours.push_back({left, right});
      slide.table.add(left, right, other_left, other_right);
      const auto code = static_cast<std::size_t>(((left * 8 + right) * 8 + other_left) * 8 + other_right);
      slide.by_code[code] = static_cast<std::int16_t>(++uses[code] == 1 ? b : -1);
    }
    slide.table.fill_up();
  }
  return out;
}

SequenceDecoder::SequenceDecoder(const Pattern& pattern)
    : slides_(slide_colours(pattern)), boundaries_(pattern.boundaries()) {}

EdgeAgreement SequenceDecoder::agreement_of(const Edge& edge, const Beside& beside) {
  return edge_agreement(edge.left, edge.right, beside.left, beside.right, beside.tracked);
}

/// What an edge is beyond doubt: every channel on both sides in both frames is clear.
void SequenceDecoder::clear_boundary(const Edge& edge, const Beside& beside, const SlideColours& shown,
                                     Clear& out) {
  out.boundary = -1;
  out.own = out.gain = 0;
  if (!beside.tracked) return;
  std::size_t code = 0;
  float least = kClear;
  std::array<float, 4> agreements{};  // with the colours that the signs tell
  std::size_t i = 0;
  for (const SideEvidence* side : {&edge.left, &edge.right, &beside.left, &beside.right}) {
    const SideEvidence& e = *side;
    code = code * 8 + static_cast<std::size_t>((e[0] > 0 ? 1 : 0) | (e[1] > 0 ? 2 : 0) | (e[2] > 0 ? 4 : 0));
    const std::array size{std::fabs(e[0]), std::fabs(e[1]), std::fabs(e[2])};
    least = std::min(std::min(least, size[0]), std::min(size[1], size[2]));
    agreements[i++] = (size[0] + size[1] + size[2]) * (1.F / 3);
  }
  if (least < kClear) return;
  out.boundary = shown.by_code[code];
  out.own = agreements[0] + agreements[1];
  out.gain = out.own + (agreements[2] + agreements[3]);
}

/// As PathKernels::choose, of an edge that moved: the other slide's frame often shows another surface there
/// and agrees with wrong boundaries by chance, so that what was seen before decides which ones are likely.
int SequenceDecoder::choose_moving(const EdgeImage& edges, int line, std::uint32_t e,
                                   const SequenceContext& context, Scratch& scratch, std::int32_t* boundary,
                                   float* gains) const {
  const BoundaryColours& colours = shown_slide(context).table;
  const auto places = static_cast<std::size_t>(colours.count) + 8;
  scratch.near_boundary.resize(places);
  scratch.near_gain.resize(places);
  const int near = path_kernels().near(colours, agreement_of(edges.edges[e], beside_[e]), kMovingGains,
                                       scratch.near_boundary.data(), scratch.near_gain.data());
  const float column = edges.edges[e].column_px;
  const bool moves = context.motion != nullptr && context.before_motion != nullptr;
  const float was = moves ? column - moved_px(line, column, context) : column;
  BestCandidates best(boundary, gains);
  for (auto i = std::size_t{0}; i < static_cast<std::size_t>(near); ++i) {
    const std::int32_t b = scratch.near_boundary[i];
    best.add(b, scratch.near_gain[i] + expected_gain(line, column, was, context, b));
  }
  return best.used();
}

void SequenceDecoder::decode_line(const EdgeImage& edges, int line, const SequenceContext& context,
                                  Scratch& scratch, SequenceResult& out) {
  constexpr int kPlaces = kPathCandidates;
  const PathKernels& kernels = path_kernels();
  const SlideColours& shown = shown_slide(context);
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::uint32_t end = edges.line_start[static_cast<std::size_t>(line) + 1];
  const int count = static_cast<int>(end - begin);
  PathCandidates& candidates = scratch.candidates;
  candidates.resize(static_cast<std::size_t>(count));
  scratch.clear.resize(static_cast<std::size_t>(count));
  BestPath path;
  for (int e = 0; e < count; ++e) {
    const auto index = begin + static_cast<std::uint32_t>(e);
    const int own = e * kPlaces;
    const Edge& edge = edges.edges[index];
    std::int32_t* boundary = candidates.boundary.data() + own;
    float* gains = candidates.gain.data() + own;
    int& used = candidates.used[static_cast<std::size_t>(e)];
    Clear clear;
    clear_boundary(edge, beside_[index], shown, clear);
    // Of a clear edge; what a doubtful one shows is asked once its path is known.
    convincing_[index] = clear.own > kLeastOwn && (context.other == nullptr || clear.gain > kLeastGain);
    scratch.clear[static_cast<std::size_t>(e)] = clear.boundary >= 0;
    if (clear.boundary >= 0) {
      used = 1;
      *boundary = clear.boundary;
      *gains = clear.gain - kGains.threshold;
    } else {
      used = beside_[index].tracked
                 ? kernels.choose(shown.table, agreement_of(edge, beside_[index]), kGains, boundary, gains)
                 : choose_moving(edges, line, index, context, scratch, boundary, gains);
      doubt_unexpected(context.expected, edge.column_px, used, boundary, gains);
    }
    path.extend(kernels, e, false, candidates);
  }
  for (std::int32_t a = path.end; a >= 0; a = candidates.from[static_cast<std::size_t>(a)]) {
    const std::uint32_t index = begin + static_cast<std::uint32_t>(a / kPlaces);
    const std::int32_t boundary = candidates.boundary[static_cast<std::size_t>(a)];
    out.boundary[index] = static_cast<std::int16_t>(boundary);
    if (scratch.clear[static_cast<std::size_t>(a / kPlaces)] == 0)
      convincing_[index] = convincing(edges.edges[index], beside_[index], context, boundary);
    ++scratch.in_order;
  }
  scratch.score += path.gain;
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

/// What the other slide's frame shows beside a line's edges: where each stood on the way between the frames
/// around that one.
void SequenceDecoder::look_beside(const EdgeImage& edges, int line, const SequenceContext& context,
                                  Scratch& scratch, SequenceResult& out) {
  const std::uint32_t begin = edges.line_start[static_cast<std::size_t>(line)];
  const std::size_t count = edges.line_start[static_cast<std::size_t>(line) + 1] - begin;
  const Edge* of_line = edges.edges.data() + begin;
  Beside* beside = beside_.data() + begin;
  scratch.off_px.assign(count, 0);
  if (context.same != nullptr) scratch.sides.look(*context.same, line, of_line, count);
  const FieldMotion* before = context.other != nullptr ? &context.other->motion : nullptr;
  const bool moves = context.motion != nullptr && before != nullptr &&
                     (context.motion->line_moves(line) || before->line_moves(line));
  for (std::size_t i = 0; i < count; ++i) {
    beside[i] = {{}, {}, true};
    const float moved =
        moves ? -context.motion->between_frames(*before, line, of_line[i].column_px, context.other_fields)
              : 0;
    if (context.same != nullptr) {
      const Sides& there = scratch.sides[i];
      if (moved != 0 || !alike(of_line[i].left, there.left) || !alike(of_line[i].right, there.right)) {
        beside[i].tracked = false;
        const Displacement d = displacement(*context.same, line, of_line[i], moved / context.other_share);
        // Over two frames a place gains more speed than over one.
        scratch.off_px[i] = moved != 0 ? moved : context.other_share * d.px;
      }
    } else if (moved != 0) {
      beside[i].tracked = false;
      scratch.off_px[i] = moved;
    }
    out.still[begin + i] = beside[i].tracked;
  }
  if (context.other == nullptr) return;
  if (context.same != nullptr) {
    scratch.sides.look_again(*context.other, line, of_line, scratch.off_px.data());
  } else {
    scratch.sides.look(*context.other, line, of_line, count);
    if (moves) scratch.sides.look_again(*context.other, line, of_line, scratch.off_px.data());
  }
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(beside[i].left.data(), scratch.sides[i].left.data(), sizeof beside[i].left);
    std::memcpy(beside[i].right.data(), scratch.sides[i].right.data(), sizeof beside[i].right);
  }
}

void SequenceDecoder::decode(const EdgeImage& edges, const SequenceContext& context, WorkerPool& pool,
                             SequenceResult& out) {
  out.boundary.assign(edges.edges.size(), -1);
  out.counts = {};
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) {
    s.score = 0;
    s.in_order = 0;
  }
  beside_.resize(edges.edges.size());
  out.still.resize(edges.edges.size());
  convincing_.resize(edges.edges.size());
  out.seen_px.resize(static_cast<std::size_t>(edges.lines) * static_cast<std::size_t>(boundaries_));
  depths_.clear();
  if (context.before_px != nullptr && context.expected != nullptr && context.motion != nullptr)
    depths_.fill(*context.before_px, *context.expected, *context.motion);
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      look_beside(edges, line, context, scratch, out);
      decode_line(edges, line, context, scratch, out);
      check_motion(edges, line, context, scratch, out);
    }
  });
  out.score = 0;
  for (const Scratch& s : scratch_) {
    out.score += s.score;
    out.counts.in_order += s.in_order;
  }
  check(edges, context, pool, out);
  complete(edges, context, out);
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
