// SPDX-License-Identifier: Apache-2.0
#include "server/working_volume.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

constexpr std::size_t kOneOutsideIn = 1000;
constexpr float kRoom = 1.25F;             // of the extent, so that the box changes rarely
constexpr std::size_t kNearestOneIn = 50;  // this part of the points is what "nearest" means

}  // namespace

const Volume& WorkingVolume::fit(const std::vector<Vec3f>& positions) {
  if (fixed_ || positions.empty()) return volume_;
  const std::size_t allowed = positions.size() / kOneOutsideIn;
  std::size_t outside = 0;
  for (const Vec3f& p : positions) {
    bool inside = true;
    for (std::size_t c = 0; c < 3; ++c) {
      inside = inside && p[c] >= volume_.min[c] && p[c] <= volume_.min[c] + volume_.size_m;
    }
    outside += !inside;
  }
  if (volume_.size_m > 0 && outside <= allowed) return volume_;

  Vec3f low{};
  Vec3f high{};
  for (std::size_t c = 0; c < 3; ++c) {
    scratch_.clear();
    for (const Vec3f& p : positions) scratch_.push_back(p[c]);
    // A sixth of what may lie outside at each of the six faces.
    const auto skip = static_cast<std::ptrdiff_t>(allowed / 6);
    std::nth_element(scratch_.begin(), scratch_.begin() + skip, scratch_.end());
    low[c] = scratch_[static_cast<std::size_t>(skip)];
    std::nth_element(scratch_.begin(), scratch_.end() - 1 - skip, scratch_.end());
    high[c] = *(scratch_.end() - 1 - skip);
    if (c == 2) {
      const auto near = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / kNearestOneIn);
      std::nth_element(scratch_.begin(), near, scratch_.end());
      distance_m_ = distance_m_ > 0 ? std::min(distance_m_, *near) : *near;
    }
    if (volume_.size_m > 0) {
      low[c] = std::min(low[c], volume_.min[c]);
      high[c] = std::max(high[c], volume_.min[c] + volume_.size_m);
    }
  }
  float size = 0;
  for (std::size_t c = 0; c < 3; ++c) size = std::max(size, high[c] - low[c]);
  size *= kRoom;
  for (std::size_t c = 0; c < 3; ++c) volume_.min[c] = 0.5F * (low[c] + high[c] - size);
  volume_.size_m = size;
  return volume_;
}

int WorkingVolume::bits(double resolution) const {
  if (fixed_ || distance_m_ <= 0) return 0;
  return std::clamp(static_cast<int>(std::ceil(std::log2(volume_.size_m / (resolution * distance_m_)))), 8,
                    20);
}

}  // namespace relievo
