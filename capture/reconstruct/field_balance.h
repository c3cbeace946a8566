// SPDX-License-Identifier: Apache-2.0
// One exposure of a frame may be brighter than the other by itself: lamps flicker, projectors and cameras
// favour a field. The difference (paper 5.2.1) then crosses zero too early where a channel rises and too late
// where it falls, which is how it is told here, and taken out before anything is decoded.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/rows.h"
#include "capture/source/field_source.h"

namespace relievo {

/// One stream's; keeps its memory from frame to frame. One thread.
class FieldBalance {
 public:
  explicit FieldBalance(const std::array<double, 9>& colour_matrix);

  /// The frame, in light, with both exposures of one brightness: `frame` itself where they are, or one that
  /// is valid until the next call.
  const CapturedFrame& balance(const CapturedFrame& frame, WorkerPool& pool);

  /// By how much the slide's exposure of the frame read last was brighter, of the mean of both: per captured
  /// channel, and of all. 0 where too few edges tell it.
  const std::array<double, 3>& excess_of_channels() const { return excess_; }
  double excess() const { return (excess_[0] + excess_[1] + excess_[2]) / 3; }

 private:
  /// Two channels that cross zero at one boundary: by how much the second lies behind the first, and by how
  /// much an offset of either takes it there, all times a weight that makes pairs equally sure.
  struct Pair {
    std::uint8_t first, second;
    float weight, apart, by_first, by_second;
  };
  struct Crossing {
    std::uint8_t channel;
    float column_px, rise_px;  // in which it rises by the exposures' sum
  };

  void measure(const DetectionLines& lines);
  void darken(const CapturedFrame& frame, WorkerPool& pool);
  void read_line(const DetectionLines& lines, int line);
  void pair_line(int width);
  std::array<double, 3> offsets();

  std::array<double, 9> mixing_;  // the colour matrix's inverse
  PlaneWeights weights_;
  std::array<double, 3> excess_{};
  std::vector<std::int16_t> rows_;
  std::vector<float> planes_;
  std::vector<std::uint8_t> flags_;
  std::vector<Crossing> crossings_;  // of a line
  std::vector<Pair> pairs_;
  std::vector<float> residuals_;
  CapturedFrame balanced_;
};

}  // namespace relievo
