// SPDX-License-Identifier: Apache-2.0
// Which depths the frame before saw around a place. From one frame to the next a surface that moves covers
// boundaries that it did not show before, but its depth stays about the same; the same colours elsewhere in
// the pattern would be at a depth at which mostly nothing was.
#pragma once

#include <bitset>
#include <cstddef>
#include <vector>

#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/field_motion.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. Reading is for any thread.
class SeenDepths {
 public:
  /// Of a frame that had boundaries at `before_px` ([line][boundary], NaN: nowhere), whose `columns` are
  /// those of the same depths each; distances by the scale of `motion`.
  void fill(const std::vector<float>& before_px, const std::vector<ColumnRange>& columns,
            const FieldMotion& motion);
  void clear() { cells_ = 0; }

  /// Whether a boundary at a place would be about as deep as something that was seen near there. False where
  /// nothing is known.
  bool has(int line, int boundary, float column_px) const;

 private:
  static constexpr int kBins = 128;
  using Depths = std::bitset<kBins>;

  /// Of a boundary: where it would be farthest, and how many bins a column is.
  struct Scale {
    float low_px, bins_a_px;
  };
  std::vector<Scale> scales_;
  int cells_ = 0;  // in a row of them, as of FieldMotion
  int rows_ = 0;
  std::vector<Depths> seen_, around_;  // [row][cell]: in it, and in those around, too
};

}  // namespace relievo
