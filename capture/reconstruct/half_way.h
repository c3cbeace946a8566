// SPDX-License-Identifier: Apache-2.0
// Where each boundary was on each line of the frame before, to place boundaries at an instant between two
// frames.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "capture/reconstruct/decoded_grid.h"

namespace relievo {

/// Keeps the frame before and its scratch memory. One thread.
class HalfWay {
 public:
  HalfWay(int boundaries, int lines, int width_px);

  /// Of the frame before, if there is one.
  std::optional<std::int64_t> time_ns() const { return time_ns_; }

  /// `out` becomes the boundaries half way between a frame's and those of the frame before: half way between
  /// their columns where both frames have them, and as their neighbours go where one has, unless
  /// another surface is there or the picture ends. False, and `out` as it was, where the frame before is none
  /// or longer ago than `longest_ns`. Once a frame.
  bool place(const DecodedGrid& now, std::int64_t time_ns, std::int64_t longest_ns, DecodedGrid& out);

 private:
  struct Column {
    float px;
    int boundary;
  };
  void place_line(const DecodedGrid& now, int line, DecodedGrid& out);
  std::optional<float> went(const DecodedGrid& now, int line, int boundary) const;

  int width_px_;  // of the picture
  std::optional<std::int64_t> time_ns_;
  DecodedGrid before_;
  std::vector<Column> columns_;  // a line's that both frames have, left to right
};

}  // namespace relievo
