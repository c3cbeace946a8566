// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/persistence.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/neighbours.h"

namespace relievo {
namespace {

// Measured on simulated scenes: of what these let through, nine out of ten are right.
constexpr float kSure_px = 0.15F;   // standard deviation in the frame before
constexpr int kLeastKnown = 4;      // neighbours that tell how far all went,
constexpr float kAlike_px = 0.25F;  // at most so unlike each other
constexpr float kFar_px = 1.F;      // what goes farther may be covered by now
constexpr float kRoom_px = 2.5F;    // to the boundaries beside it
constexpr float kLeast_px = 0.05F;  // standard deviation that carrying adds, at least

/// Whether all boundaries of a line are where the pattern has them beside one there.
bool has_room(const PlaceGrid& places, int line, int boundary, float column_px) {
  const Place* here = places.line(line);
  for (int b = 0; b < places.boundaries(); ++b) {
    if (!here[b].known()) continue;
    if (b < boundary ? here[b].column_px + kRoom_px > column_px : column_px + kRoom_px > here[b].column_px)
      return false;
  }
  return true;
}

}  // namespace

void Persistence::carry_line(const MovingPlaces& moving, const PlaceGrid& places, int line,
                             std::vector<RecoveredBoundary>& out) const {
  const Place* now = places.line(line);
  const Place* before = before_.line(line);
  for (int b = 0; b < places.boundaries(); ++b) {
    if (now[b].known() || !(before[b].known() && before[b].sigma_px < kSure_px)) continue;
    auto [went, count] = neighbours_went([&](int lines, int boundaries) {
      const std::ptrdiff_t step = lines * places.stride() + boundaries;
      return now[b + step].column_px - before[b + step].column_px;
    });
    if (count < kLeastKnown) continue;
    std::sort(went.begin(), went.begin() + static_cast<std::ptrdiff_t>(count));
    const float middle = went[count / 2];
    const float apart = std::max(middle - went[0], went[count - 1] - middle);
    if (apart > kAlike_px || std::fabs(middle) > kFar_px) continue;
    const float column = before[b].column_px + middle;
    if (moving.around(line, column) > 0 || !has_room(places, line, b, column)) continue;
    out.push_back({line, b, column, std::hypot(before[b].sigma_px, apart, kLeast_px), 0});
  }
}

std::size_t Persistence::carry(const MovingPlaces& moving, WorkerPool& pool, PlaceGrid& places,
                               std::vector<RecoveredBoundary>& recovered) {
  carried_.resize(static_cast<std::size_t>(pool.workers()));
  for (auto& one : carried_) one.clear();
  if (before_.lines() == places.lines() && before_.boundaries() == places.boundaries()) {
    pool.for_ranges(places.lines(), [&](int begin, int end, int worker) {
      for (int line = begin; line < end; ++line)
        carry_line(moving, places, line, carried_[static_cast<std::size_t>(worker)]);
    });
  }
  before_ = places;
  std::size_t added = 0;
  for (const auto& one : carried_) {
    for (const RecoveredBoundary& r : one) places.line(r.line)[r.boundary] = {r.column_px, r.sigma_px};
    recovered.insert(recovered.end(), one.begin(), one.end());
    added += one.size();
  }
  return added;
}

}  // namespace relievo
