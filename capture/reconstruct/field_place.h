// SPDX-License-Identifier: Apache-2.0
// Where boundaries are that move, by the field of the slide alone. From a slide's exposure to its
// complement's silhouettes, shade and texture move on: the two do not add up to white there, and their
// difference has boundaries off their places. The slide's own field shows all at one instant; it is only not
// as sure of a place as both are where all holds still.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_step.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/slide_field.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class FieldPlacer {
 public:
  /// `colour_matrix` as of StepFinder.
  FieldPlacer(const std::array<double, 9>& colour_matrix, int boundaries)
      : steps_(colour_matrix), boundaries_(boundaries) {}

  /// Weighs columns of `edges`, which must be those of the field's instant, against what the field shows
  /// where something moves, by its `moving`; updates standard deviations.
  void place(const SlideFieldView& view, const SequenceResult& result, WorkerPool& pool, EdgeImage& edges);

 private:
  void fill(const SequenceResult& result, const EdgeImage& edges);
  void look_at_line(const SlideFieldView& view, int line, const SequenceResult& result,
                    const EdgeImage& edges);
  void weigh_line(int line, int lines, const SequenceResult& result, EdgeImage& edges) const;
  const std::int32_t* row(int line) const {
    return edge_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
  }

  StepFinder steps_;
  int boundaries_;
  std::vector<std::int32_t> edge_;  // [line][boundary]: -1 where it has none
  struct Seen {
    float off_px;    // of the field's place from the edge's column; NaN: none
    float sigma_px;  // of the field's place
  };
  std::vector<Seen> seen_;  // one an edge
};

}  // namespace relievo
