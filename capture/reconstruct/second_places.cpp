// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/second_places.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "capture/reconstruct/sequence_rules.h"

namespace relievo {
namespace {

using sequence_rules::agreement;

// Measured on simulated scenes and a rendering by others. An edge's own colours and those of the other slide,
// if there is one, must be clear on both sides: beside a rim they are mixed.
constexpr float kLeastSide = 0.5F;
constexpr float kWorst_px = 0.16F;  // standard deviation
constexpr float kApart_px = 2.F;    // nearer its first place it is that one's own edge, blurred
constexpr float kGoesOn_px = 0.8F;  // off where what is above, below or beside goes on to,
constexpr float kForetold = 0.7F;   // towards which it is put so far: the other surface draws it off
constexpr float kLean_px = 4.F;     // from line to line: farther off is another surface
constexpr float kNarrowest_px = 1.F, kWidest_px = 40.F;  // of a stripe
constexpr int kSweeps = 2;
constexpr float kHeldStill_px = 1.F;  // from frame to frame: farther apart are two surfaces

std::tuple<int, int> place(const SecondPlace& p) {
  return {p.line, p.boundary};
}

std::size_t primary(const SideEvidence& e) {
  return static_cast<std::size_t>((e[0] > 0 ? 1 : 0) | (e[1] > 0 ? 2 : 0) | (e[2] > 0 ? 4 : 0));
}

}  // namespace

void SecondPlaces::find_candidates(const DecodedEdges& frame, int line, Candidates& out) const {
  const auto& colours = frame.sequence.shown_colours(frame.context.order);
  const float* first_px = frame.first.column_px(line);
  for (std::uint32_t e = frame.edges.line_start[static_cast<std::size_t>(line)];
       e < frame.edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
    const Edge& edge = frame.edges.edges[e];
    if (frame.result.boundary[e] >= 0 || frame.result.still[e] == 0 || edge.at_step ||
        edge.sigma_px > kWorst_px || frame.moving.around(line, edge.column_px) > 0)
      continue;
    for (const std::int16_t b : by_colours_[primary(edge.left) * 8 + primary(edge.right)]) {
      if (!(std::fabs(first_px[b] - edge.column_px) > kApart_px)) continue;
      const auto [left, right] = colours[static_cast<std::size_t>(b)];
      const float own = std::min(agreement(left, edge.left), agreement(right, edge.right));
      if (own > kLeastSide && (frame.context.other == nullptr ||
                               frame.sequence.other_agreement(edge, line, b, frame.context) > kLeastSide))
        out.push_back({line, b, e});
    }
  }
}

/// Of a boundary's two places on a line, that next to `column_px`. NaN: it has none.
float SecondPlaces::near(const DecodedGrid& first, int line, int boundary, float column_px) const {
  const float one = first.column_px(line)[boundary];
  const float other = second_.line(line)[boundary];
  return std::fabs(other - column_px) < std::fabs(one - column_px) || one != one ? other : one;
}

/// Where what is above, below or beside goes on to, nearest to the edge. NaN: nothing does so near it.
float SecondPlaces::foretold_px(const DecodedEdges& frame, const Candidate& c) const {
  const float x = frame.edges.edges[c.edge].column_px;
  float best = kNoColumn;
  const auto say = [&](float foretold_px) {
    if (!(std::fabs(foretold_px - x) >= std::fabs(best - x)) && std::fabs(foretold_px - x) <= kGoesOn_px)
      best = foretold_px;
  };
  for (const int d : {-1, 1}) {
    const float x0 = near(frame.first, c.line + d, c.boundary, x);
    const float x1 = near(frame.first, c.line + 2 * d, c.boundary, x0);
    say(x0);
    if (std::fabs(x0 - x) < kLean_px && std::fabs(x1 - x0) < kLean_px) say(2 * x0 - x1);
    const float beside = near(frame.first, c.line, c.boundary + d, x);
    const float next = near(frame.first, c.line, c.boundary + 2 * d, beside);
    const float gap = static_cast<float>(d) * (beside - x);
    if (gap > kNarrowest_px && gap < kWidest_px) say(2 * beside - next);
  }
  return best;
}

void SecondPlaces::clear() {
  for (const SecondPlace& p : found_) second_.line(p.line)[p.boundary] = kNoColumn;
  found_.clear();
}

std::size_t SecondPlaces::find(const DecodedEdges& frame, WorkerPool& pool) {
  const DecodedGrid& first = frame.first;
  const auto& colours = frame.sequence.shown_colours(frame.context.order);
  if (second_.boundaries() != first.boundaries() || second_.lines() != first.lines())
    second_.reset(first.boundaries(), first.lines(), kNoColumn);
  for (auto& boundaries : by_colours_) boundaries.clear();
  for (std::size_t b = 0; b < colours.size(); ++b)
    by_colours_[static_cast<std::size_t>(colours[b][0] * 8 + colours[b][1])].push_back(
        static_cast<std::int16_t>(b));
  of_lines_.resize(static_cast<std::size_t>(pool.workers()));
  for (Candidates& of : of_lines_) of.clear();
  pool.for_shares(frame.edges.line_start, [&](int begin, int end, int worker) {
    Candidates& of = of_lines_[static_cast<std::size_t>(worker)];
    for (int line = std::max(begin, 1); line < std::min(end, first.lines()); ++line)
      find_candidates(frame, line, of);
  });
  candidates_.clear();
  for (const Candidates& of : of_lines_) candidates_.insert(candidates_.end(), of.begin(), of.end());
  taken_.assign(frame.edges.edges.size(), 0);
  const auto take = [&](const Candidate& c) {
    float& second = second_.line(c.line)[c.boundary];
    if (taken_[c.edge] != 0 || second == second) return;
    const Edge& edge = frame.edges.edges[c.edge];
    const float foretold = foretold_px(frame, c);
    if (!(foretold == foretold)) return;
    const float moved = kForetold * (foretold - edge.column_px);
    second = edge.column_px + moved;
    taken_[c.edge] = 1;
    found_.push_back({static_cast<std::uint16_t>(c.boundary), static_cast<std::uint16_t>(c.line), second,
                      std::hypot(edge.sigma_px, moved)});
  };
  // Each one found confirms others.
  for (int i = 0; i < kSweeps; ++i) {
    for (const Candidate& c : candidates_) take(c);
    for (auto c = candidates_.rbegin(); c != candidates_.rend(); ++c) take(*c);
  }
  std::ranges::sort(found_, {}, place);
  return found_.size();
}

void second_half_way(const std::vector<SecondPlace>& before, const std::vector<SecondPlace>& now,
                     std::vector<SecondPlace>& out) {
  out.clear();
  auto other = before.begin();
  for (SecondPlace p : now) {
    other = std::find_if(other, before.end(), [&](const SecondPlace& o) { return place(o) >= place(p); });
    if (other == before.end()) break;
    if (place(*other) != place(p) || std::fabs(other->column_px - p.column_px) > kHeldStill_px) continue;
    p.column_px = 0.5F * (p.column_px + other->column_px);
    out.push_back(p);
  }
}

}  // namespace relievo
