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

DepthRange::DepthRange(int boundaries, int width, int lines)
    : width_(width), lines_(lines), columns_(static_cast<std::size_t>(boundaries)) {}

void DepthRange::update(const std::vector<GridVertex>& vertices, const Triangulator& triangulator) {
  if (vertices.size() < kLeastPoints) return;
  inverse_depths_.clear();
  for (const GridVertex& v : vertices) inverse_depths_.push_back(1 / v.position[2]);
  const auto quantile = [&](std::size_t rank) {
    const auto at = inverse_depths_.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(inverse_depths_.begin(), at, inverse_depths_.end());
    return *at;
  };
  const std::size_t rank = vertices.size() / kOutliers;
  float far = quantile(rank);
  float near = quantile(vertices.size() - 1 - rank);
  const float wider = kWider * (near - far);
  far -= wider + kWiderShare * far;
  near += wider + kWiderShare * near;

  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  for (std::size_t b = 0; b < columns_.size(); ++b) {
    // Along a line, inverse depth on a boundary's light sheet is linear in the column (but for distortion):
    // it is taken through the two outermost columns at which ray and sheet meet.
    std::optional<std::array<float, 2>> first, last;  // column, inverse depth
    for (int i = 0; i < kSamples; ++i) {
      const float column = static_cast<float>(i * (width_ - 1)) / (kSamples - 1);
      const auto point = triangulator.point(static_cast<int>(b), lines_ / 2, column);
      if (!point) continue;
      last = {column, 1 / (*point)[2]};
      if (!first) first = last;
    }
    columns_[b] = {-kInfinite, kInfinite};
    if (!first || (*first)[0] == (*last)[0] || (*first)[1] == (*last)[1]) continue;
    const auto column_of = [&](float inverse_depth) {
      return (*first)[0] +
             (inverse_depth - (*first)[1]) * ((*last)[0] - (*first)[0]) / ((*last)[1] - (*first)[1]);
    };
    const auto [low, high] = std::minmax({column_of(far), column_of(near)});
    columns_[b] = {low - kMargin_px, high + kMargin_px};
  }
  known_ = true;
}

}  // namespace relievo
