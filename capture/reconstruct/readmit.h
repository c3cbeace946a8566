// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries that were given up, each for a weakness of its own: a step of the scene at its place, a
// standard deviation that is too large beside one, another place under the other slide. Where what stayed
// goes on to such a boundary's place, the surface confirms it, and it is taken back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class Readmission {
 public:
  Readmission(int boundaries, int lines);

  /// Gives edges that are `doubted` to be a boundary back to it where those on the lines above or below, or
  /// both of those beside it on the line, confirm it; those taken back confirm others. Moves the edges
  /// towards where these predict them and updates their standard deviations. `recovered` are boundaries
  /// beside those of `result`, which stay. Returns how many were taken back.
  std::size_t readmit(const std::vector<RecoveredBoundary>& recovered, SequenceResult& result,
                      EdgeImage& edges);

 private:
  struct Candidate {
    int line;
    std::uint32_t edge;
  };
  struct Place {
    float column_px;  // NaN where there is none
    int off;          // lines to a boundary that was never given up
  };
  /// What the lines above and below say of a boundary's place.
  struct Prediction {
    float sum_px = 0;
    int count = 0;
    int off = 0;
  };
  Place* row(int line);
  void fill(const std::vector<RecoveredBoundary>& recovered, const SequenceResult& result,
            const EdgeImage& edges);
  Prediction predict(const Candidate& candidate, int boundary, bool still, const Edge& edge);
  bool take_back(const Candidate& candidate, SequenceResult& result, EdgeImage& edges);

  int boundaries_, lines_;
  std::size_t stride_;
  std::vector<Place> places_;  // [line][boundary] with a margin
  std::vector<Candidate> candidates_;
  bool mostly_still_ = false;  // the scene, but for what moves in it
};

}  // namespace relievo
