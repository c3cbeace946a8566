// SPDX-License-Identifier: Apache-2.0
// Boundaries that lean where brightness changes from line to line: at the rims of what is lit, on shaded
// folds, beside eyebrows and lips. A mean over lines keeps a boundary's place where all are as bright; else
// the brighter ones, which have it elsewhere, draw it there.
#pragma once

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/margin_grid.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class LeanCorrection {
 public:
  /// Puts the decoded edges of `image` back where their own line has them. `between`: the difference's two
  /// fields lie half a line apart (DetectionLines).
  void correct(const DifferenceImage& image, bool between, int boundaries, const SequenceResult& result,
               WorkerPool& pool, EdgeImage& edges);

 private:
  struct Seen {
    float column_px = kNoColumn;
    float slope = 0;
  };
  static float drawn_px(const Seen* here, std::ptrdiff_t stride);

  MarginGrid<Seen, 1> seen_;
};

}  // namespace relievo
