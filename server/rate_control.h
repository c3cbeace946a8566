// SPDX-License-Identifier: Apache-2.0
// Keeps a stream's bit rate: texture quality and geometry step move together along a measured table. Nothing
// is queued for it and nothing dropped: a frame is made smaller before it is encoded.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "codec/frame3d_codec.h"

namespace relievo {

/// A place of the table: the finest is 0.
struct RateLevel {
  int texture_quality;
  int step_bits;
  double size;  // of a whole frame, level 0 being 1: as measured (server/rate_control.cpp says how)
};
std::span<const RateLevel> rate_levels();

/// One thread. Pure: the same sizes give the same levels.
class RateControl {
 public:
  /// Both above 0; the rate is that of the camera's frames, and those that are missing only make the stream
  /// smaller.
  RateControl(double bits_per_s, double frames_per_s);

  /// Sets quality and step for the next frame, none finer than `options` says already.
  void apply(EncodeOptions& options) const;
  /// What the frame became. Key frames are larger: they count with their share, 1 of `key_interval`.
  void add(std::size_t bytes, bool is_key, int key_interval);

  int level() const { return level_; }

 private:
  double expected(double level_size, int key_interval) const;

  double target_bytes_;                // a frame
  std::optional<double> key_, delta_;  // smoothed sizes of such frames, as they would be at level 0
  int level_;
  int patience_ = 0;  // frames for which a finer level would have fitted
};

}  // namespace relievo
