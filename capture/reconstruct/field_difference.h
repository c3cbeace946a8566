// SPDX-License-Identifier: Apache-2.0
// The difference image of a frame's two fields (paper 5.2.1): what every decoder starts from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/field_motion.h"
#include "capture/reconstruct/line_steps.h"
#include "capture/reconstruct/rows.h"

namespace relievo {

/// How much of the projected light comes back in one place.
enum class Signal : std::uint8_t {
  kNone,    // nothing that stands out of the noise
  kWeak,    // so little that values are means over more pixels (capture/reconstruct/weak_signal.h)
  kFading,  // the same, but otherwise on the next lines: means over fewer of them
  kStrong,  // enough for each pixel by itself
};

/// D of 5.2.1: calibrated slide minus calibrated complement, low-passed along and across lines, not
/// normalised. Line l lies at camera row 2 l of an interlaced frame, at row l of a progressive one.
struct DifferenceImage {
  int width = 0;
  int lines = 0;
  std::vector<float> values;  // [line][channel][width]
  std::vector<float> white;   // [line][width]: luma of the fields' sum, what the scene shows in white light
  float noise = 0;            // standard deviation of a value, from the picture itself
  float weak_noise = 0;       // the same where the signal is weak,
  float fading_noise = 0;     // and where it is fading

  static constexpr int kCellWidth = 16;
  static constexpr int kCellLines = 8;
  int cells = 0;               // in a row of them, 0 where none was measured: all is strong
  std::vector<Signal> signal;  // [row of cells][cell], a cell is kCellWidth pixels of kCellLines lines

  LineSteps steps;     // beside which no mean over lines was taken
  FieldMotion motion;  // between the fields, which both were shifted by half of it to meet half way

  Signal signal_at(int l, int x) const {
    if (cells == 0) return Signal::kStrong;
    return signal[static_cast<std::size_t>(l / kCellLines) * static_cast<std::size_t>(cells) +
                  static_cast<std::size_t>(x / kCellWidth)];
  }
  float noise_of(Signal s) const {
    return s == Signal::kWeak ? weak_noise : s == Signal::kFading ? fading_noise : noise;
  }
  float noise_at(int l, int x) const { return noise_of(signal_at(l, x)); }

  const float* white_line(int l) const {
    return white.data() + static_cast<std::size_t>(l) * static_cast<std::size_t>(width);
  }
  const float* line(int l) const {
    return values.data() + static_cast<std::size_t>(l) * 3 * static_cast<std::size_t>(width);
  }
};

/// Keeps its scratch memory from frame to frame. One thread.
class Differencer {
 public:
  explicit Differencer(const std::array<double, 9>& colour_matrix);

  /// Low-pass, colour matrix (Eq. 3) and difference. `out` is overwritten; its memory is reused.
  void difference(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out);

  /// The same, of the fields where each shows its stripes half way between both exposures; where a line
  /// beside shows another surface, without it.
  void aligned_difference(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out);

  /// Of the calibrated fields, low-passed along the line, all channels: 255 of the paper's normalised scale.
  float largest(const DetectionLines& rows, WorkerPool& pool);

 private:
  struct Scratch {
    std::vector<std::int16_t> rows;
    std::vector<float> motion;          // of each column of a line
    std::vector<std::uint8_t> shifted;  // rows of the fields
    float largest = 0;
  };
  void difference_of_lines(const DetectionLines& rows, int begin, int end, Scratch& scratch,
                           DifferenceImage& out) const;

  void difference_of_all(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out);

  std::array<float, 9> matrix_;
  PlaneWeights weights_;
  MotionFinder motion_finder_;
  LineStepFinder step_finder_;
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
