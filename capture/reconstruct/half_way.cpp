// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/half_way.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <numbers>

namespace relievo {
namespace {

// A boundary that moved further along its line is on another surface now: 1 m/s in depth is 5 px a frame.
constexpr float kFurthest_px = 8;

// Of one that a single frame has.
constexpr std::size_t kLeastKnown = 6;  // neighbours that tell how far it goes,
constexpr float kAlike_px = 2;          // at most so unlike each other
constexpr float kRoom_px = 4;           // to those of its own surface
constexpr float kOther_px = 16;         // and of another one, whose edge nobody saw at that instant
constexpr int kOwn = 2;                 // boundaries: nearer ones are of its own surface
constexpr float kMore_px = 0.1F;        // standard deviation more

}  // namespace

HalfWay::HalfWay(int boundaries, int lines, int width_px) : width_px_(width_px) {
  before_.reset(boundaries, lines);
}

/// How far a place's neighbours go from frame to frame, where they go alike.
std::optional<float> HalfWay::went(const DecodedGrid& now, int line, int boundary) const {
  std::array<float, 24> went{};
  std::size_t count = 0;
  for (int lines = -3; lines <= 3; ++lines) {
    for (int boundaries = -2; boundaries <= 2; ++boundaries) {
      if (std::abs(lines) + std::abs(boundaries) > 3) continue;
      const float px = now.column_px(line + lines)[boundary + boundaries] -
                       before_.column_px(line + lines)[boundary + boundaries];
      if (std::fabs(px) <= kFurthest_px) went[count++] = px;
    }
  }
  if (count < kLeastKnown) return std::nullopt;
  std::sort(went.begin(), went.begin() + static_cast<std::ptrdiff_t>(count));
  if (went[count - 1] - went[0] > kAlike_px) return std::nullopt;
  return went[count / 2];
}

void HalfWay::place_line(const DecodedGrid& grid, int line, DecodedGrid& out) {
  const float* before = before_.column_px(line);
  const float* now = grid.column_px(line);
  const auto known = [](float column) { return column == column; };
  out.start_line(line);
  columns_.clear();
  for (int b = 0; b < grid.boundaries(); ++b) {
    if (!(std::fabs(before[b] - now[b]) <= kFurthest_px)) continue;
    // Both columns are as exact, so their mean is more so.
    const float column = 0.5F * (before[b] + now[b]);
    out.put(line, b, column, grid.sigma_px(line)[b] * std::numbers::sqrt2_v<float> / 2, 0);
    columns_.push_back({column, b});
  }
  std::ranges::sort(columns_, {}, &Column::px);
  for (int b = 0; b < grid.boundaries(); ++b) {
    if (known(before[b]) == known(now[b])) continue;
    const std::optional<float> px = went(grid, line, b);
    if (!px) continue;
    const float column = known(now[b]) ? now[b] - 0.5F * *px : before[b] + 0.5F * *px;
    if (!(column > -0.5F && column < static_cast<float>(width_px_) - 0.5F)) continue;
    const auto right = std::ranges::lower_bound(columns_, column, {}, &Column::px);
    const auto is_free = [&](const Column& other) {
      const float room_px = std::abs(other.boundary - b) <= kOwn ? kRoom_px : kOther_px;
      return std::fabs(other.px - column) >= room_px;
    };
    if (right != columns_.end() && !is_free(*right)) continue;
    if (right != columns_.begin() && !is_free(*std::prev(right))) continue;
    const float sigma = known(now[b]) ? grid.sigma_px(line)[b] : before_.sigma_px(line)[b];
    out.put(line, b, column, std::hypot(sigma, kMore_px), 0);
  }
}

bool HalfWay::place(const DecodedGrid& now, std::int64_t time_ns, std::int64_t longest_ns, DecodedGrid& out) {
  const bool follows = time_ns_ && time_ns > *time_ns_ && time_ns - *time_ns_ <= longest_ns;
  if (follows)
    for (int line = 0; line < now.lines(); ++line) place_line(now, line, out);
  before_ = now;
  time_ns_ = time_ns;
  return follows;
}

}  // namespace relievo
