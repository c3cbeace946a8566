// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries against those of the frame before. It showed the other slide, so what blur and texture
// do to a boundary was something else there: an edge that could not be decoded, just where a boundary must be
// by the frame before and by how far its neighbours moved since, is that boundary; and one at the end of a
// surface that moved unlike its neighbours is none.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/quick_sequence.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Every count is of boundaries.
struct ContinuityCounts {
  std::size_t rejected = 0;  // that moved unlike their neighbours
  std::size_t carried = 0;   // that only the frame before shows to be what they are
};

/// Keeps the frame before and its scratch memory. One thread.
class Continuity {
 public:
  Continuity(int boundaries, int lines);

  /// Gives up boundaries of `result`, gives edges of no boundary the one they are by the frame before and
  /// moves those edges towards where it puts them. Once a frame. `recovered` are boundaries beside those of
  /// `result`, which stay.
  ContinuityCounts check(const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool,
                         SequenceResult& result, EdgeImage& edges);

  /// The same of what a check left of the edges of `sequence`.
  ContinuityCounts check(QuickSequence& sequence, ConsistencyCheck& checked, WorkerPool& pool);

 private:
  struct Motion {
    float px;
    int neighbours;  // that tell it
  };
  float* row(std::vector<float>& grid, int line) const;
  const float* row(const std::vector<float>& grid, int line) const;
  Motion motion(int line, int boundary) const;
  bool moved_alone(int line, int boundary, bool plain) const;
  ContinuityCounts end_frame();
  std::size_t drop_line(int line, SequenceResult& result, const EdgeImage& edges) const;
  std::optional<float> expected_px(int line, int boundary) const;
  bool goes_on(int line, int boundary, float column_px) const;
  std::size_t carry_line(int line, SequenceResult& result, EdgeImage& edges) const;
  std::size_t carry_line(int line, const QuickLine& edges, ConsistencyCheck& checked) const;

  int boundaries_, lines_;
  std::size_t stride_;
  std::vector<float> now_;     // [line][boundary] with a margin: column, NaN where there is none
  std::vector<float> before_;  // the same, of the frame before
  bool have_before_ = false;
  std::vector<ContinuityCounts> counts_;  // one a worker
};

}  // namespace relievo
