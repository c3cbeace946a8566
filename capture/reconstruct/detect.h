// SPDX-License-Identifier: Apache-2.0
// Stripe boundaries and projected colours of one camera frame (paper 5.2.1, 5.2.2).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Thresholds are on the paper's normalised scale, where the brightest calibrated channel of the frame is
/// 255.
struct DetectOptions {
  int delta_px = 2;             // neighbours looked at on both sides of a boundary (Eq. 4, 5)
  int search_px = 6;            // how far beyond delta colours are searched (5.2.2)
  float slope_threshold = 5;    // ts of Eq. 4
  float colour_threshold = 20;  // tc: two channels must differ by more
  float merge_px = 2;           // crossings of different channels closer than this are one boundary
};

/// One stripe boundary on a line.
struct Boundary {
  float column_px = 0;  // sub-pixel camera column
  float slope = 0;      // of the difference image across it, normalised grey levels a pixel, all channels
  Primary left = 0;     // projected colours on both sides, never equal, never black or white
  Primary right = 0;
};

/// What one frame shows, on its detection lines.
struct Detection {
  int width = 0;
  int lines = 0;
  std::vector<std::uint32_t>
      line_start;  // lines + 1 entries: boundaries of line l are [line_start[l], line_start[l + 1])
  std::vector<Boundary> boundaries;  // by line, then left to right
  std::vector<Primary> colours;      // width x lines: PC of 5.2.2, 0 where invalid
};

/// Pure but for its scratch memory, which it keeps from frame to frame. One thread.
class Detector {
 public:
  Detector(const std::array<double, 9>& colour_matrix, const DetectOptions& options);

  /// Low-pass, colour matrix (Eq. 3), normalisation, difference, zero crossings (Eq. 4), colours (Eq. 5).
  /// `out` is overwritten; its memory is reused.
  void detect(const DetectionLines& rows, WorkerPool& pool, Detection& out);

 private:
  struct Crossing {
    float column_px;
    float slope;
  };
  struct LineScratch {
    std::vector<Crossing> crossings;    // of one line
    std::vector<Boundary> found;        // of the worker's lines
    std::vector<std::uint32_t> counts;  // boundaries of each of them
  };
  void boundaries_of_line(int line, float scale, LineScratch& scratch, Detection& detection) const;

  DetectOptions options_;
  Differencer differencer_;
  DifferenceImage image_;
  std::vector<LineScratch> scratch_;  // one a worker
};

/// True where both frames show the same slide: the colours agree at most of the pixels valid in both (5.2.3).
bool same_slide(const Detection& a, const Detection& b);

}  // namespace relievo
