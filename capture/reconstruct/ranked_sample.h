// SPDX-License-Identifier: Apache-2.0
// Medians and other quantiles of what a frame's workers measured: the same whoever measured what, and in time
// that grows with the number of values alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace relievo {

/// Keeps its memory from frame to frame. One thread but for of(): each worker has its own.
class RankedSample {
 public:
  /// Empties it for workers [0, workers).
  void reset(int workers) {
    parts_.resize(static_cast<std::size_t>(workers));
    for (auto& part : parts_) part.clear();
  }
  /// To append to. No value may be NaN.
  std::vector<float>& of(int worker) { return parts_[static_cast<std::size_t>(worker)]; }

  std::size_t size() const;
  /// What would be at `rank` (< size()) if all values were sorted.
  float at(std::size_t rank);
  /// The middle value, of an even number the upper one; `none` where there is no value.
  float median(float none) { return size() == 0 ? none : at(size() / 2); }

 private:
  std::vector<std::vector<float>> parts_;
  std::vector<std::int32_t> keys_;        // of all values
  std::vector<std::uint16_t> bucket_of_;  // each of them is in
  std::vector<std::uint32_t> counts_;     // of buckets of values
};

}  // namespace relievo
