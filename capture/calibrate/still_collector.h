// SPDX-License-Identifier: Apache-2.0
// Waits until a scene under a repeating cycle of slides holds still, and averages what it shows meanwhile.
// Frames are told apart by what they show alone, so cycles may begin anywhere and frames may be lost.
#pragma once

#include <cstdint>
#include <vector>

#include "capture/calibrate/stripe_decode.h"
#include "capture/source/field_source.h"

namespace relievo {

/// One thread.
class StillCollector {
 public:
  /// `cycle`: frames that differ from each other while nothing moves, e.g. two slides along each axis: 4.
  explicit StillCollector(std::size_t cycle) : cycle_(cycle) {}

  /// True once for each time that the scene came to rest: every frame of the cycle was seen twice since.
  bool add(const CapturedFrame& frame);

  /// The means of each frame of the cycle, as whole pictures, in the order in which they were first seen.
  std::vector<StripePair> pairs() const;
  /// The same, each pair's slide and then its complement.
  std::vector<Image8> pictures() const;

  /// Frames of the cycle that were seen twice since something moved: 0 while it moves, up to the cycle.
  std::size_t at_rest() const;

 private:
  struct Shown {
    std::vector<float> blocks;           // means of blocks of both fields, each channel
    std::vector<std::uint32_t> sums[2];  // of the frame's pictures
    int width = 0, height = 0;
    Scan scan = Scan::kInterlaced;
    int slide_row = 0;  // of an interlaced frame: its first row under the slide
    std::uint32_t count = 0;
    std::uint64_t last = 0;  // of the frames added
  };
  static void accumulate(const CapturedFrame& frame, Shown& shown);

  std::size_t cycle_;
  std::uint64_t added_ = 0;
  bool taken_ = false;
  std::vector<Shown> shown_;  // oldest first
};

}  // namespace relievo
