// SPDX-License-Identifier: Apache-2.0
// The inner loops of the path search along a line (sequence.h): which boundaries an edge may be, and the best
// way there from the edges before it. As rows.h: a portable reference, and others with the same results for
// what a processor can do beyond it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/pattern.h"

namespace relievo {

/// Boundaries kept for an edge, the most likely ones.
constexpr int kPathCandidates = 8;

/// A number for each primary.
using PerPrimary = std::array<float, 8>;

/// Of the boundaries of a pattern, in their order: the primaries beside them under the slide that the newer
/// frame shows and under the other one. Filled up with black, which is beside no boundary, to a multiple of
/// eight.
struct BoundaryColours {
  int count = 0;  // with the filling
  std::vector<std::int32_t> left, right, other_left, other_right;

  void add(Primary l, Primary r, Primary ol, Primary o_r);
  void fill_up();
};

/// How well each primary agrees with what was seen beside an edge, -1..1, in the newer frame and in the other
/// slide's. In the newer frame those of primaries that are beside no boundary, as black, are far below -1.
struct EdgeAgreement {
  PerPrimary left, right, other_left, other_right;
  bool tracked;  // the scene held still there, so that the other slide's frame may contradict
};

/// Gains of calling an edge a boundary; see sequence.cpp.
struct GainRules {
  float transition_slack;  // own agreement may be so far off the best
  float other_floor;       // least gain from the other frame where the scene may have moved
  float contradiction;     // agreement of one side in it below which it contradicts
  float contradicted;      // and what that costs
  float threshold;         // taken off
};

/// Gains of a path from edge to edge.
struct OrderRules {
  float in_order;     // of the boundary that follows in the sequence
  float per_missing;  // less for each one missed in between
  int max_missing;
};

/// The candidates of a line's edges, kPathCandidates places an edge, of which the first `used` are taken.
struct PathCandidates {
  std::vector<std::int32_t> used;  // one an edge
  std::vector<std::int32_t> boundary;
  std::vector<float> gain;         // of calling the edge this boundary, evidence alone
  std::vector<float> best;         // of the best path that ends here
  std::vector<std::int32_t> from;  // place of the candidate before it on that path, -1 where the path starts

  void resize(std::size_t edges);
};

/// The best kPathCandidates of those added, by gain and of equal ones the first, in the order of adding.
class BestCandidates {
 public:
  /// Written to the front of `boundary` and `gain`, each of kPathCandidates places.
  BestCandidates(std::int32_t* boundary, float* gain) : boundary_(boundary), gain_(gain) {}

  void add(std::int32_t boundary, float gain);
  int used() const { return used_; }

 private:
  std::int32_t* boundary_;
  float* gain_;
  int used_ = 0;
  int worst_ = 0;  // makes room for a better one: of equal ones the last
};

/// A path goes on in order to `edge` from the edges [first, edge), or starts there.
struct PathStep {
  int first, edge;
  float start;              // gain of starting anew or of jumping here, from `start_from` (or -1)
  std::int32_t start_from;  // a place
};

struct PathKernels {
  const char* name;

  /// Writes the best boundaries for an edge, by gain and of equal ones the first, in the sequence's order, to
  /// the front of `boundary` and `gain`, each of kPathCandidates places; returns how many. Own agreement is
  /// not below 0.
  int (*choose)(const BoundaryColours& colours, const EdgeAgreement& edge, const GainRules& rules,
                std::int32_t* boundary, float* gain);

  /// The same, but all whose own agreement is near enough the best. `boundary` and `gain` have colours.count
  /// places each and eight more.
  int (*near)(const BoundaryColours& colours, const EdgeAgreement& edge, const GainRules& rules,
              std::int32_t* boundary, float* gain);

  /// Fills best and from of the edge's places in use. Of equal ways the first in place is taken.
  void (*extend)(const PathStep& step, const OrderRules& rules, PathCandidates& candidates);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<PathKernels>& all_path_kernels();

/// The best that runs on this machine.
const PathKernels& path_kernels();

}  // namespace relievo
