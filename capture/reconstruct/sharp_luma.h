// SPDX-License-Identifier: Apache-2.0
// Luma of a frame's two fields as the camera gave it, before any low-pass. Where the scene's brightness
// changes across a boundary, a low-pass mixes the stripes of the brighter side into the darker one and draws
// the boundary along; the ratio of difference to sum, taken pixel by pixel, stays where the boundary is.
#pragma once

#include "capture/reconstruct/detection_lines.h"

namespace relievo {

/// Refers to the frame it was made of. Any thread.
class SharpLuma {
 public:
  explicit SharpLuma(const DetectionLines& rows) : rows_(rows) {}

  /// Slide minus complement over their sum plus `dark`, at columns [first, first + count) of `line` (as
  /// DifferenceImage's) and, with half its weight each, of the lines above and below. All must be inside the
  /// picture; `ratio` holds `count`.
  void ratio(int line, int first, int count, float dark, float* ratio) const;

 private:
  DetectionLines rows_;
};

}  // namespace relievo
