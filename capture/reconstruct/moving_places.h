// SPDX-License-Identifier: Apache-2.0
// Where something moves, by boundaries that were elsewhere two frames ago: several around, for one alone may
// be a track that was lost.
#pragma once

#include <cstdint>
#include <vector>

#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its memory from frame to frame. One thread writes; any may read between.
class MovingPlaces {
 public:
  static constexpr int kMost = 6;

  /// Of a frame `width` columns wide, by the decoded boundaries of `result`.
  void find(int width, const SequenceResult& result, const EdgeImage& edges);
  /// The same by those of `places` that `checked` does not mark as still.
  void find(int width, ConsistencyCheck& checked, const PlaceGrid& places);

  /// After the first find(): whether so much moves that what holds still by itself may be seen past it in one
  /// field only.
  bool much() const { return much_; }

  /// How many such boundaries are around a place, up to kMost.
  int around(int line, float column_px) const {
    const int cell = static_cast<int>(column_px) / kCell_px;
    return cell >= 0 && cell < cells_ ? around_[static_cast<std::size_t>(line * cells_ + cell)] : 0;
  }

 private:
  static constexpr int kCell_px = 4;

  void reset(int width, int lines);
  void add(int line, float column_px);

  int lines_ = 0;
  bool much_ = false;
  int cells_ = 0;                     // in a line
  std::vector<std::uint8_t> around_;  // [line][cell]
};

}  // namespace relievo
