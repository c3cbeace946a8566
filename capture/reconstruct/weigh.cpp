// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/weigh.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/place_rules.h"

namespace relievo {

using place_rules::squared;

namespace {

// Standard deviations of what is foretold, measured on simulated scenes.
constexpr float kStraight_px = 0.06F;  // from three neighbours in line
constexpr float kBend = 1.4F;          // more for each pixel that the three are out of line
constexpr float kTwoAcross_px = 1.F;   // more, from two only
constexpr float kTwoAlong_px = 0.2F;
constexpr float kBetween = 0.1F;  // of the difference of the lines above and below
constexpr float kAlong = 1.5F;    // times these along the boundary: errors there are the place's own errors
constexpr float kAgree = 3.F;     // standard deviations between a place and what is foretold of it

constexpr float kUnsure_px = 0.08F;  // what is surer than this stays as it is
constexpr float kOwn = 1.3F;         // times its standard deviation: blur across a step is no noise
constexpr float kOwnLeast_px = 0.02F;
constexpr float kOut_px = 0.15F;  // outwards, at the end of a surface

/// A place's own column and all that is foretold of it and agrees, by their variances.
Place weighed(const Place* own, std::ptrdiff_t stride) {
  const float own_variance = squared(kOwn * own->sigma_px) + squared(kOwnLeast_px);
  float weights = 1 / own_variance;
  float sum = weights * own->column_px;
  const auto take = [&](float column_px, float variance) {
    const float apart = squared(column_px - own->column_px);
    if (!(apart < kAgree * kAgree * (variance + own_variance))) return;  // nor what is not known
    weights += 1 / variance;
    sum += column_px / variance;
  };
  // From three neighbours in one direction, or two.
  const auto foretell = [&](std::ptrdiff_t step, bool across) {
    const float two_px = across ? kTwoAcross_px : kTwoAlong_px;
    const float times = across ? 1 : kAlong;
    const Place &a = own[step], &b = own[2 * step], &c = own[3 * step];
    const float bend = a.column_px - 2 * b.column_px + c.column_px;
    const bool three = bend == bend;
    const float model = three ? kStraight_px + kBend * std::fabs(bend) : kStraight_px + two_px;
    const float share = three ? kBendGoesOn : 0;
    const float noise = squared((2 + share) * a.sigma_px) + squared((1 + 2 * share) * b.sigma_px) +
                        squared(share * c.sigma_px);
    const std::array<float, 3> x{a.column_px, b.column_px, c.column_px};
    const Foretold there = across && three && !own[-step].known()
                               ? ends_on(x, {a.sigma_px, b.sigma_px, c.sigma_px})
                               : foretold(x);
    take(there.column_px, squared(times) * (squared(model + there.unsure_px) + squared(kOwn) * noise));
  };
  foretell(-1, true);
  foretell(1, true);
  foretell(-stride, false);
  foretell(stride, false);
  const Place &above = own[-stride], &below = own[stride];
  const float apart = below.column_px - above.column_px;
  take(0.5F * (above.column_px + below.column_px),
       squared(kAlong) * (squared(kStraight_px + kBetween * std::fabs(apart)) +
                          squared(kOwn / 2) * (squared(above.sigma_px) + squared(below.sigma_px))));
  // Where the surface ends its end is its own.
  float column_px = sum / weights;
  if (!own[-1].known()) column_px = std::max(column_px, own->column_px - kOut_px);
  if (!own[1].known()) column_px = std::min(column_px, own->column_px + kOut_px);
  return {column_px, 1 / std::sqrt(weights)};
}

/// Weighs a place, unless the grid has another one of that boundary.
void settle(const PlaceGrid& places, int line, int boundary, float& column_px, float& sigma_px) {
  const Place* own = places.line(line) + boundary;
  if (own->column_px != column_px) return;
  const Place now = weighed(own, places.stride());
  column_px = now.column_px;
  sigma_px = now.sigma_px;
}

}  // namespace

std::size_t weigh(const PlaceGrid& places, WorkerPool& pool, DecodedGrid& out) {
  std::atomic<std::size_t> weighed{0};
  pool.for_ranges(places.lines(), [&](int begin, int end, int) {
    std::size_t own = 0;
    for (int line = begin; line < end; ++line) {
      const Place* from = places.line(line);
      const DecodedRow to = out.decoded(line);
      std::fill_n(to.slope, places.boundaries(), 1.F);
      for (int b = 0; b < places.boundaries(); ++b) {
        to.column_px[b] = from[b].column_px;
        to.sigma_px[b] = from[b].sigma_px;
      }
      for (int b = 0; b < places.boundaries(); ++b) {
        if (!from[b].known() || from[b].sigma_px < kUnsure_px) continue;
        settle(places, line, b, to.column_px[b], to.sigma_px[b]);
        ++own;
      }
    }
    weighed += own;
  });
  return weighed;
}

std::size_t weigh(const PlaceGrid& places, WorkerPool& pool, const SequenceResult& result, EdgeImage& edges,
                  std::vector<RecoveredBoundary>& recovered) {
  std::atomic<std::size_t> weighed{0};
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    std::size_t own = 0;
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        Edge& edge = edges.edges[e];
        if (result.boundary[e] < 0 || edge.sigma_px < kUnsure_px) continue;
        settle(places, line, result.boundary[e], edge.column_px, edge.sigma_px);
        ++own;
      }
    }
    weighed += own;
  });
  for (RecoveredBoundary& r : recovered) {
    if (r.sigma_px < kUnsure_px) continue;
    settle(places, r.line, r.boundary, r.column_px, r.sigma_px);
    ++weighed;
  }
  return weighed;
}

}  // namespace relievo
