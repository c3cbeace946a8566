// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/weigh.h"

#include <algorithm>
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
constexpr float kOut_px = 0.15F;    // outwards, at the end of a surface
constexpr float kStrong_px = 0.5F;  // standard deviation of what is foretold and nothing agrees with
constexpr float kMost_px = 0.85F;   // standard deviation, after weighing, times how far neighbours pulled,
constexpr float kMostMoving_px = 0.55F;  // and where so many boundaries around were elsewhere: there it is
constexpr int kMoves = 4;                // the silhouette's, and errors are several times as large

}  // namespace

/// A place's own column and all that is foretold of it and agrees, by their variances. Nothing where it is to
/// be given up.
std::optional<Place> Weighing::weighed(const Place* own, std::ptrdiff_t stride, float most_px) const {
  const float own_variance = squared(kOwn * own->sigma_px) + squared(kOwnLeast_px);
  float weights = 1 / own_variance;
  float sum = weights * own->column_px;
  float off = 0;
  int count = 0;
  bool against = false;
  const auto take = [&](float column_px, float variance) {
    const float apart = squared(column_px - own->column_px);
    const float expected = variance + own_variance;
    if (!(apart < kAgree * kAgree * expected)) {
      against = against || (apart == apart && variance < kStrong_px * kStrong_px);
      return;  // nor what is not known
    }
    weights += 1 / variance;
    sum += column_px / variance;
    off += apart / expected;
    ++count;
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
  if (count == 0 && against) return std::nullopt;
  // Where the surface ends its end is its own.
  float column_px = sum / weights;
  if (!own[-1].known()) column_px = std::max(column_px, own->column_px - kOut_px);
  if (!own[1].known()) column_px = std::min(column_px, own->column_px + kOut_px);
  const float sigma_px = 1 / std::sqrt(weights);
  const float doubt = count == 0 ? 0 : off / static_cast<float>(count);
  if (sigma_px * (1 + doubt) > most_px * scale_) return std::nullopt;
  return Place{column_px, sigma_px};
}

/// Weighs a place; false where it is to be given up.
bool Weighing::settle(const PlaceGrid& places, const MovingPlaces& moving, int line, int boundary,
                      float& column_px, float& sigma_px) const {
  const Place* own = places.line(line) + boundary;
  if (own->column_px != column_px) return true;  // the grid has another one of that boundary
  const float most_px = moving.around(line, column_px) >= kMoves ? kMostMoving_px : kMost_px;
  const std::optional<Place> now = weighed(own, places.stride(), most_px);
  if (!now) return false;
  column_px = now->column_px;
  sigma_px = now->sigma_px;
  return true;
}

WeighingCounts Weighing::total() const {
  WeighingCounts total;
  for (const WeighingCounts& c : counts_) {
    total.moved += c.moved;
    total.rejected += c.rejected;
  }
  return total;
}

WeighingCounts Weighing::weigh(const PlaceGrid& places, const MovingPlaces& moving, float scale,
                               WorkerPool& pool, DecodedGrid& out) {
  scale_ = scale;
  counts_.assign(static_cast<std::size_t>(pool.workers()), {});
  pool.for_ranges(places.lines(), [&](int begin, int end, int worker) {
    WeighingCounts& counts = counts_[static_cast<std::size_t>(worker)];
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
        if (settle(places, moving, line, b, to.column_px[b], to.sigma_px[b])) {
          ++counts.moved;
        } else {
          to.column_px[b] = kNoColumn;
          ++counts.rejected;
        }
      }
    }
  });
  return total();
}

WeighingCounts Weighing::weigh(const PlaceGrid& places, const MovingPlaces& moving, float scale,
                               WorkerPool& pool, SequenceResult& result, EdgeImage& edges,
                               std::vector<RecoveredBoundary>& recovered) {
  scale_ = scale;
  counts_.assign(static_cast<std::size_t>(pool.workers()), {});
  pool.for_shares(edges.line_start, [&](int begin, int end, int worker) {
    WeighingCounts& counts = counts_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        Edge& edge = edges.edges[e];
        std::int16_t& boundary = result.boundary[e];
        if (boundary < 0 || edge.sigma_px < kUnsure_px) continue;
        if (settle(places, moving, line, boundary, edge.column_px, edge.sigma_px)) {
          ++counts.moved;
        } else {
          boundary = -1;
          ++counts.rejected;
        }
      }
    }
  });
  WeighingCounts total = this->total();
  const std::size_t found = recovered.size();
  std::size_t sure = 0;
  std::erase_if(recovered, [&](RecoveredBoundary& r) {
    const bool is_sure = r.sigma_px < kUnsure_px;
    sure += is_sure;
    return !is_sure && !settle(places, moving, r.line, r.boundary, r.column_px, r.sigma_px);
  });
  total.moved += recovered.size() - sure;
  total.rejected += found - recovered.size();
  return total;
}

}  // namespace relievo
