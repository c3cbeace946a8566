// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/depth_range.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace relievo {
namespace {

constexpr std::size_t kLeastPoints = 500;
constexpr std::size_t kOutliers = 200;  // one point in so many, nearest and farthest, is not believed
constexpr float kWider = 0.3F;          // of the range of inverse depths, on both sides
constexpr float kWiderShare = 0.06F;    // and of the inverse depth itself
constexpr float kMargin_px = 6;         // lines differ
constexpr int kSamples = 9;             // columns at which a boundary's depth is asked

}  // namespace

DepthRange::DepthRange(int boundaries, int width, int lines, int every)
    : width_(width), lines_(lines), every_(every), columns_(static_cast<std::size_t>(boundaries)) {}

void DepthRange::update(const DecodedGrid& grid, std::size_t points, const Triangulator& triangulator,
                        WorkerPool& pool) {
  if (points < kLeastPoints) return;
  depths_.reset(pool.workers());
  pool.for_ranges((grid.lines() + every_ - 1) / every_, [&](int begin, int end, int worker) {
    std::vector<float>& own = depths_.of(worker);
    own.resize(static_cast<std::size_t>(end - begin) * static_cast<std::size_t>(grid.boundaries()));
    std::size_t count = 0;
    for (int i = begin; i < end; ++i) {
      const float* z = grid.z(i * every_);
      for (int b = 0; b < grid.boundaries(); ++b) {
        own[count] = z[b];
        count += z[b] == z[b];
      }
    }
    own.resize(count);
  });
  const std::size_t asked = depths_.size();
  if (asked == 0) return;
  const std::size_t rank = asked / kOutliers;
  float far = 1 / depths_.at(asked - 1 - rank);
  float near = 1 / depths_.at(rank);
  const float wider = kWider * (near - far);
  far -= wider + kWiderShare * far;
  near += wider + kWiderShare * near;

  pool.for_ranges(static_cast<int>(columns_.size()), [&](int begin, int end, int) {
    for (int b = begin; b < end; ++b)
      columns_[static_cast<std::size_t>(b)] = range_of(b, {far, near}, triangulator);
  });
  known_ = true;
}

/// Columns at which a boundary shows inverse depths of `range`.
ColumnRange DepthRange::range_of(int boundary, std::array<float, 2> range,
                                 const Triangulator& triangulator) const {
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  const ColumnRange everywhere{-kInfinite, kInfinite};
  // Along a line, inverse depth on a boundary's light sheet is linear in the column (but for distortion): it
  // is taken through the two outermost columns at which ray and sheet meet.
  std::optional<std::array<float, 2>> first, last;  // column, inverse depth
  for (int i = 0; i < kSamples; ++i) {
    const float column = static_cast<float>(i * (width_ - 1)) / (kSamples - 1);
    const auto point = triangulator.point(boundary, lines_ / 2, column);
    if (!point) continue;
    last = {column, 1 / (*point)[2]};
    if (!first) first = last;
  }
  if (!first || (*first)[0] == (*last)[0] || (*first)[1] == (*last)[1]) return everywhere;
  const auto column_of = [&](float inverse_depth) {
    return (*first)[0] +
           (inverse_depth - (*first)[1]) * ((*last)[0] - (*first)[0]) / ((*last)[1] - (*first)[1]);
  };
  const auto [low, high] = std::minmax({column_of(range[0]), column_of(range[1])});
  return {low - kMargin_px, high + kMargin_px};
}

}  // namespace relievo
