// SPDX-License-Identifier: Apache-2.0
// Boundaries that lean where brightness changes from line to line: at the rims of what is lit, on shaded
// folds, beside eyebrows and lips. A mean over lines keeps a boundary's place where all are as bright; else
// the brighter ones, which have it elsewhere, draw it there; and a line on which there is nothing, beyond the
// top or the bottom of what is lit, seems to have what the line beside it has.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/parallel.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/margin_grid.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class LeanCorrection {
 public:
  /// Puts the decoded edges of `image`, which was made of `rows`, back where their own line has them. Gives
  /// up those that it does not have, whose number it returns.
  std::size_t correct(const DetectionLines& rows, const DifferenceImage& image, int boundaries,
                      WorkerPool& pool, SequenceResult& result, EdgeImage& edges);

 private:
  struct Seen {
    float column_px = kNoColumn;
    float slope = 0;
  };
  static float drawn_px(const Seen* here, std::ptrdiff_t stride);
  static float one_sided_px(const Seen* here, std::ptrdiff_t stride, std::uint8_t sides);
  bool is_borrowed(const DetectionLines& rows, float noise, int line, const Seen* here) const;

  MarginGrid<Seen, 1> seen_;
};

}  // namespace relievo
