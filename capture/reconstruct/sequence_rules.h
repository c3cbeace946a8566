// SPDX-License-Identifier: Apache-2.0
// What the decoders that go by the sequence's order share: how well colours agree with what was seen, and the
// gains by which a path along a line is chosen.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/line_path.h"

namespace relievo::sequence_rules {

// Gains of the path search. Evidence of one side is a colour's agreement with three channels, -1..1; a clear
// edge of a still scene has 2 from its own frame and 2 from the other slide's.
inline constexpr GainRules kGains{
    .transition_slack = 0.9F,  // of the best pair of colours: further off is no candidate
    .other_floor = -0.6F,      // what the other slide's frame can take away: the scene may have moved
    .contradiction = 0.0F,     // but where it held still, a side that disagrees
    .contradicted = 1.5F,      // costs this much more
    .threshold = 1.3F,         // an edge that gains less is better left out
};
inline constexpr OrderRules kOrder{
    .in_order = 1.0F,     // bonus for the boundary that follows in the sequence
    .per_missing = 0.5F,  // less for each boundary missed in between
    .max_missing = 3,
};
inline constexpr float kJump = -1.6F;       // a depth step: anything may follow
inline constexpr float kUnexpected = 1.0F;  // less for a boundary where no depth seen before would put it
inline constexpr int kMaxSkipped = 3;       // false edges between two that follow each other
inline constexpr float kClear = 0.5F;       // of a channel's evidence: leaves no doubt about its sign
inline constexpr float kNoStripe = -100;    // agreement with what no stripe is

// How far an edge may have moved in two frames: 1 m/s in depth is 10 px where a stripe is 8 wide.
inline constexpr float kSearch_px = 14;
inline constexpr float kSearchStep_px = 2;
inline constexpr float kSearchMoving_px = 4;  // around where its motion between the fields puts it

// What a decoded edge must show by itself, whatever its neighbours are.
inline constexpr float kLeastSide = 0.4F;  // of agreement on each side: no channel may clearly disagree
inline constexpr float kLeastOwn = 1.1F;   // of both sides
inline constexpr float kLeastGain = 2.0F;  // with the other slide's frame, where the scene held still

inline float agreement(Primary colour, const SideEvidence& e) {
  return ((colour & 1 ? e[0] : -e[0]) + (colour & 2 ? e[1] : -e[1]) + (colour & 4 ? e[2] : -e[2])) *
         (1.F / 3);
}

/// Of every primary; its complement's is the opposite.
inline PerPrimary agreements(const SideEvidence& e) {
  PerPrimary out;
  for (std::size_t c = 4; c < 8; ++c) {
    out[c] = agreement(static_cast<Primary>(c), e);
    out[7 - c] = -out[c];
  }
  return out;
}

inline EdgeAgreement edge_agreement(const SideEvidence& left, const SideEvidence& right,
                                    const SideEvidence& other_left, const SideEvidence& other_right,
                                    bool tracked) {
  EdgeAgreement out{agreements(left), agreements(right), agreements(other_left), agreements(other_right),
                    tracked};
  for (PerPrimary* side : {&out.left, &out.right})  // no stripe is black or white
    side->front() = side->back() = kNoStripe;
  return out;
}

/// Takes from an edge's candidates what depths seen before, if there are any, do not explain.
inline void doubt_unexpected(const std::vector<ColumnRange>* expected, float column_px, int used,
                             const std::int32_t* boundary, float* gains) {
  for (int i = 0; i < used && expected != nullptr; ++i) {
    const auto [low, high] = (*expected)[static_cast<std::size_t>(boundary[i])];
    if (column_px < low || column_px > high) gains[i] -= kUnexpected;
  }
}

/// The best path along a line's edges, as far as they were added.
struct BestPath {
  float gain = 0;
  std::int32_t end = -1;  // the place at which it ends; -1: it is empty

  /// By the next edge, whose candidates have their gains. `must_end`: the path ends at one of them.
  void extend(const PathKernels& kernels, int edge, bool must_end, PathCandidates& candidates) {
    const float jump_from = gain + kJump;
    const bool jump = jump_from > 0;  // a path may start anywhere
    kernels.extend({.first = std::max(0, edge - 1 - kMaxSkipped),
                    .edge = edge,
                    .start = jump ? jump_from : 0,
                    .start_from = jump ? end : -1},
                   kOrder, candidates);
    const std::int32_t own = edge * kPathCandidates;
    for (std::int32_t a = own; a < own + candidates.used[static_cast<std::size_t>(edge)]; ++a) {
      const float best = candidates.best[static_cast<std::size_t>(a)];
      end = best > gain || must_end ? a : end;
      gain = std::max(best, gain);
    }
  }
};

/// `b` has three numbers or more.
template <std::size_t N>
bool alike(const SideEvidence& a, const std::array<float, N>& b) {
  const float dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const float size = std::fabs(a[0]) + std::fabs(a[1]) + std::fabs(a[2]);
  return dot > 0.5F * size;
}

/// Gain from the other slide's frame, where the colours on the two sides agree with it by `left` and `right`.
inline float other_gain(float left, float right, bool tracked) {
  if (!tracked) return std::max(kGains.other_floor, left + right);
  return left + right - (std::min(left, right) < kGains.contradiction ? kGains.contradicted : 0);
}

}  // namespace relievo::sequence_rules
