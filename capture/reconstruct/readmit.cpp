// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/readmit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relievo {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kMargin = 2;

// Measured on simulated scenes: of what these let through, nine out of ten are right.
constexpr float kAlong_px = 0.6F;      // off what the line above or below predicts
constexpr float kRegular = 1.4F;       // times a distance of boundaries, the one next to it
constexpr float kLeastRoom_px = 1.F;   // to the boundaries beside it
constexpr float kWidest_px = 40.F;     // of a stripe
constexpr float kPredicted_px = 0.2F;  // standard deviation of a prediction
constexpr float kOwnShare = 0.5F;  // of the weight of its own place, which what it was doubted for draws off
constexpr float kWorst_px = 0.3F;  // standard deviation of a boundary where the scene holds still,
constexpr float kWorstMoving_px = 0.2F;  // and where it moves
// Where the scene holds still, what is against a boundary is as good as what is for it, unless contrast
// spoils both; and a step's own edge goes on from a true boundary over many lines.
constexpr float kPlain = 0.2F;
constexpr int kFurthest = 4;  // lines

bool known(float x) {
  return x == x;
}

/// Whether two distances side by side are those of stripes on one surface. True where one is not known.
bool regular(float a_px, float b_px) {
  return !(a_px > kRegular * b_px) && !(b_px > kRegular * a_px);
}

}  // namespace

Readmission::Readmission(int boundaries, int lines)
    : boundaries_(boundaries),
      lines_(lines),
      stride_(static_cast<std::size_t>(boundaries) + 2 * kMargin),
      places_(stride_ * static_cast<std::size_t>(lines + 2 * kMargin), Place{kNone, 0}) {}

Readmission::Place* Readmission::row(int line) {
  return places_.data() + static_cast<std::size_t>(line + kMargin) * stride_ + kMargin;
}

void Readmission::fill(const std::vector<RecoveredBoundary>& recovered, const SequenceResult& result,
                       const EdgeImage& edges) {
  candidates_.clear();
  std::size_t decoded = 0;
  std::size_t still = 0;
  for (int line = 0; line < lines_; ++line) {
    Place* here = row(line);
    std::fill_n(here, boundaries_, Place{kNone, 0});
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
      if (result.boundary[e] >= 0) {
        here[result.boundary[e]].column_px = edges.edges[e].column_px;
        ++decoded;
        still += result.still[e];
      } else if (result.doubted[e] >= 0) {
        candidates_.push_back({line, e});
      }
    }
  }
  for (const RecoveredBoundary& r : recovered) row(r.line)[r.boundary].column_px = r.column_px;
  mostly_still_ = 2 * still > decoded;
}

/// Of neighbours whose surface goes on to the edge, straight or not.
Readmission::Prediction Readmission::predict(const Candidate& candidate, int boundary, bool still,
                                             const Edge& edge) {
  Prediction out{.off = std::numeric_limits<int>::max()};
  for (const int direction : {-1, 1}) {
    const Place next = row(candidate.line + direction)[boundary];
    if (direction < 0 ? edge.above_differs : edge.below_differs) continue;
    if (!known(next.column_px) || (still && next.off >= kFurthest)) continue;
    const float straight = 2 * next.column_px - row(candidate.line + 2 * direction)[boundary].column_px;
    const bool by_straight =
        std::fabs(straight - edge.column_px) < std::fabs(next.column_px - edge.column_px);
    const float place = by_straight ? straight : next.column_px;
    if (!(std::fabs(place - edge.column_px) < kAlong_px)) continue;
    out.sum_px += place;
    ++out.count;
    out.off = std::min(out.off, next.off + 1);
  }
  return out;
}

bool Readmission::take_back(const Candidate& candidate, SequenceResult& result, EdgeImage& edges) {
  const int b = result.doubted[candidate.edge];
  Place* here = row(candidate.line) + b;
  if (result.boundary[candidate.edge] >= 0 || known(here->column_px)) return false;
  Edge& edge = edges.edges[candidate.edge];
  const bool still = result.still[candidate.edge] != 0;
  if (!still && !mostly_still_) return false;  // what is around it moves, too, and is as wrong
  if (edge.sigma_px > (still ? kWorst_px : kWorstMoving_px)) return false;
  if (still && edge.contrast < kPlain) return false;
  const float own = edge.column_px;
  const float left = own - here[-1].column_px;
  const float right = here[1].column_px - own;
  if (left < kLeastRoom_px || right < kLeastRoom_px) return false;
  const Prediction along = predict(candidate, b, still, edge);
  const bool between = left < kWidest_px && right < kWidest_px && regular(left, right) &&
                       regular(left, here[-1].column_px - here[-2].column_px) &&
                       regular(right, here[2].column_px - here[1].column_px);
  if (along.count == 0 && !between) return false;
  if (along.count > 0) {
    const float own_weight = kOwnShare / (edge.sigma_px * edge.sigma_px);
    const float one_weight = 1 / (kPredicted_px * kPredicted_px);
    const float weights = own_weight + one_weight * static_cast<float>(along.count);
    edge.column_px = (own_weight * own + one_weight * along.sum_px) / weights;
    edge.sigma_px = std::hypot(1 / std::sqrt(weights), edge.column_px - own);
  }
  result.boundary[candidate.edge] = static_cast<std::int16_t>(b);
  *here = {edge.column_px, along.count > 0 ? along.off : 1};
  return true;
}

std::size_t Readmission::readmit(const std::vector<RecoveredBoundary>& recovered, SequenceResult& result,
                                 EdgeImage& edges) {
  fill(recovered, result, edges);
  std::size_t taken = 0;
  for (const Candidate& c : candidates_) taken += take_back(c, result, edges);
  for (auto c = candidates_.rbegin(); c != candidates_.rend(); ++c) taken += take_back(*c, result, edges);
  return taken;
}

}  // namespace relievo
