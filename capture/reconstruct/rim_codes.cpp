// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/rim_codes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "capture/reconstruct/luma_place.h"

namespace relievo {
namespace {

// Of the distance of the other surface's boundaries: farther from its first one, and that would have one more
// in between.
constexpr float kOfBack = 1.15F;
constexpr float kOfFront = 0.95F;

// What is as sure as this, and where its own surface foretells it, is a boundary.
constexpr float kSure_px = 0.06F;
constexpr float kForetold_px = 0.2F;
constexpr float kBendShare = 0.7F;  // of a bend that is taken to go on

// Where the scene's brightness changes.
constexpr float kNear_px = 1.6F;
constexpr float kBeyond_px = 2.F;
constexpr float kBeside_px = 1.F;

/// Whether a place goes on from those of its surface, which are on its `side` (-1, 1).
bool goes_on(const Place* own, int side) {
  const float next = own[side].column_px;
  const float second = own[2 * side].column_px;
  const float bend = next - 2 * second + own[3 * side].column_px;
  const float foretold = 2 * next - second + (bend == bend ? kBendShare * bend : 0);
  return own->sigma_px < kSure_px && std::fabs(foretold - own->column_px) < kForetold_px;
}

/// Whether the scene's brightness changes most between two columns where it does so next to `column_px`.
bool steepest_near(const float* white, int width, float from_px, float to_px, float column_px) {
  const int first = std::max(0, static_cast<int>(std::ceil(from_px)));
  const int last = std::min(width - 2, static_cast<int>(to_px) - 1);
  float steepest = 0;
  float off_px = 0;
  for (int x = first; x <= last; ++x) {
    const float step = std::fabs(white[x + 1] - white[x]) / (white[x + 1] + white[x] + kDarkSum);
    if (step <= steepest) continue;
    steepest = step;
    off_px = static_cast<float>(x) + 0.5F - column_px;
  }
  return std::fabs(off_px) < kNear_px;
}

/// How many of a line are taken out of `here`, which holds `count`.
int drop_rims_of_line(const float* white, int width, const StripeColours& shown, const StripeColours& other,
                      Place* here, int count) {
  int dropped = 0;
  int before = -1;
  for (int b = 0; b < count; ++b) {
    if (!here[b].known()) continue;
    const int left = std::exchange(before, b);
    if (left < 0 || left + 1 == b) continue;
    const auto l = static_cast<std::size_t>(left);
    const auto r = static_cast<std::size_t>(b);
    if (shown[l][1] != shown[r][0] || other[l][1] != other[r][0]) continue;
    const float apart = here[b].column_px - here[left].column_px;
    if (!(apart > 0)) continue;
    const float of_left = here[left].column_px - here[left - 1].column_px;
    const float of_right = here[b + 1].column_px - here[b].column_px;
    const float from_px = here[left].column_px;
    const float to_px = here[b].column_px;
    if (apart < kOfFront * of_left) {
      if (goes_on(here + b, 1) ||
          !steepest_near(white, width, from_px + kBeside_px, to_px + kBeyond_px, to_px))
        continue;
      here[b] = {};
      before = left;
      ++dropped;
    } else if (apart < kOfBack * of_right) {
      if (goes_on(here + left, -1) ||
          !steepest_near(white, width, from_px - kBeyond_px, to_px - kBeside_px, from_px))
        continue;
      here[left] = {};
      ++dropped;
    }
  }
  return dropped;
}

}  // namespace

std::size_t drop_rims(const DifferenceImage& image, const StripeColours& shown, const StripeColours& other,
                      WorkerPool& pool, PlaceGrid& places, SequenceResult& result, const EdgeImage& edges,
                      std::vector<RecoveredBoundary>& recovered) {
  std::atomic<std::size_t> total{0};
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      Place* here = places.line(line);
      const int dropped =
          drop_rims_of_line(image.white_line(line), image.width, shown, other, here, places.boundaries());
      if (dropped == 0) continue;
      total += static_cast<std::size_t>(dropped);
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
           e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e) {
        std::int16_t& boundary = result.boundary[e];
        if (boundary >= 0 && !here[boundary].known()) boundary = -1;
      }
    }
  });
  if (total == 0) return 0;
  std::erase_if(recovered,
                [&](const RecoveredBoundary& r) { return !places.line(r.line)[r.boundary].known(); });
  return total;
}

}  // namespace relievo
