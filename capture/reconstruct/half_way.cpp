// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/half_way.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace relievo {
namespace {

// A boundary that moved further along its line is on another surface now: 1 m/s in depth is 5 px a frame.
constexpr float kFurthest_px = 8;

}  // namespace

bool LastColumns::half_way(const std::vector<DecodedBoundary>& now, std::int64_t time_ns,
                           std::int64_t longest_ns, std::vector<DecodedBoundary>& out) const {
  out.clear();
  if (columns_.empty() || time_ns <= time_ns_ || time_ns - time_ns_ > longest_ns) return false;
  for (const DecodedBoundary& b : now) {
    const auto place = static_cast<std::size_t>(b.line) * width_ + static_cast<std::size_t>(b.boundary);
    if (static_cast<std::size_t>(b.boundary) >= width_ || place >= columns_.size()) continue;
    const float before_px = columns_[place];
    if (!(std::fabs(before_px - b.column_px) <= kFurthest_px)) continue;
    // Both columns are as exact, so their mean is more so.
    out.push_back({b.boundary, b.line, 0.5F * (before_px + b.column_px),
                   b.sigma_px * std::numbers::sqrt2_v<float> / 2, b.slope});
  }
  return true;
}

void LastColumns::keep(const std::vector<DecodedBoundary>& boundaries, std::int64_t time_ns) {
  time_ns_ = time_ns;
  std::size_t lines = 0;
  for (const DecodedBoundary& b : boundaries) {
    width_ = std::max(width_, static_cast<std::size_t>(b.boundary) + 1);
    lines = std::max(lines, static_cast<std::size_t>(b.line) + 1);
  }
  columns_.assign(lines * width_, std::numeric_limits<float>::quiet_NaN());
  for (const DecodedBoundary& b : boundaries)
    columns_[static_cast<std::size_t>(b.line) * width_ + static_cast<std::size_t>(b.boundary)] = b.column_px;
}

}  // namespace relievo
