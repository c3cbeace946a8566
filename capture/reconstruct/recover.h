// SPDX-License-Identifier: Apache-2.0
// Boundaries that detection missed or the consistency check gave up beside depth steps and shadows: blurred
// chroma has no zero crossing there, but the surface beside them tells where they must be, and luma, which is
// sharp, whether they are there.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/refine.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

struct RecoveredBoundary {
  int line;
  int boundary;  // of the pattern
  float column_px;
  float sigma_px;
  float slope;  // as Edge::slope: 0, so that a detected edge at the same place is preferred
};

/// What the frame and the last one under the other slide show.
struct RecoveryView {
  const DifferenceImage& shown;
  View8 slide;  // the field under the shown slide itself, a row a line
  const std::vector<std::array<Primary, 2>>& shown_colours;  // of each boundary, left and right
  const DifferenceImage* other = nullptr;                    // none with a pattern of one slide
  const std::vector<std::array<Primary, 2>>& other_colours;
};

/// Keeps its scratch memory from frame to frame. One thread.
class Recovery {
 public:
  /// Boundaries of the pattern that `result` lacks, by line and boundary. Boundaries at the end of a surface
  /// that the other slide contradicts are given up first (-1): another surface's, decoded in this one's
  /// order; and doubted ones that it confirms are taken back. `refiner` must have refined the same frame.
  /// `out` is overwritten; its memory is reused.
  void recover(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges,
               SequenceResult& result, WorkerPool& pool, std::vector<RecoveredBoundary>& out);

 private:
  struct Prediction {
    float column_px;
    float sigma_px;
  };
  void reset(int boundaries, int lines);
  void fill_line(const SequenceResult& result, const EdgeImage& edges, int line, bool with_doubted,
                 std::vector<float>& grid) const;
  void check_line(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges, int line,
                  SequenceResult& result) const;
  const float* row(int line) const;
  Prediction predict(View8 slide, int line, int boundary) const;
  void settle_doubts(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges, int line,
                     SequenceResult& result) const;
  static std::optional<std::uint32_t> edge_at(const EdgeImage& edges, const SequenceResult& result, int line,
                                              float column_px);
  void recover_line(const RecoveryView& view, const Refiner& refiner, const EdgeImage& edges, int line,
                    SequenceResult& result, std::vector<RecoveredBoundary>& out) const;

  int boundaries_ = 0;
  std::size_t stride_ = 0;
  std::vector<float> doubted_;  // as columns_, of doubted boundaries and the others
  std::vector<float> columns_;  // [line][boundary] with a margin: NaN where there is none
  std::vector<std::vector<RecoveredBoundary>> found_;  // one a worker
};

}  // namespace relievo
