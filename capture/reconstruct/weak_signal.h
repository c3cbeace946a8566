// SPDX-License-Identifier: Apache-2.0
// Where little of the projected light comes back: dark, distant or grazing surfaces. A difference of a few
// grey levels is lost in a pixel's noise but not in the mean over some tens of pixels, and stripes are wide
// enough for that.
#pragma once

#include <array>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/field_difference.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class WeakSignal {
 public:
  /// Decides for each cell of `image` how strong its signal is against `image.noise`, and replaces the values
  /// of weak and fading cells by weighted means of those around. Sets image.signal and what noise is there.
  void average(WorkerPool& pool, DifferenceImage& image);

 private:
  struct Scratch {
    std::vector<float> sums;      // of a few lines: [channel][width]
    std::vector<float> squares;   // of the blocks' means, by cell of one cell row
    std::vector<float> averaged;  // the weak cells' values, in the order of the cells
  };
  static void measure(int cell_row, Scratch& scratch, DifferenceImage& image);
  static void mark_fading(int rows, DifferenceImage& image);
  static void average_cell(const DifferenceImage& image, int cell_row, int cell, Scratch& scratch);

  std::vector<Scratch> scratch_;
};

}  // namespace relievo
