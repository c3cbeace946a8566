// SPDX-License-Identifier: Apache-2.0
// Boundaries beside the edges of what moves. A silhouette has moved on between a slide's field and its
// complement's, and further since the other slide's: there the difference of the fields and the other slide
// show two surfaces. The slide's own field shows one, at the frame's own instant; where boundaries on the
// lines around and on the line itself tell which one must be there, or what was there before something
// passed, it tells whether and where it is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_step.h"
#include "capture/reconstruct/moving_cells.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/slide_field.h"
#include "capture/reconstruct/uncovered.h"

namespace relievo {

/// Keeps the frame before and its scratch memory. One thread.
class Growth {
 public:
  /// `colour_matrix` as of StepFinder.
  Growth(const std::array<double, 9>& colour_matrix, int boundaries, int lines);

  /// Adds boundaries that neither `result` nor `recovered` has to either; what was added leads to more. What
  /// moved into view after the field's instant is given up first. Once a frame. Columns must be those of
  /// the field's instant. Returns how many were added.
  std::size_t grow(const SlideFieldView& view, const EdgeImage& edges, WorkerPool& pool,
                   SequenceResult& result, std::vector<RecoveredBoundary>& recovered);

  /// What stands still, as far as frames told that so far.
  const Backdrop& backdrop() const { return uncovered_.backdrop(); }

 private:
  struct Prediction : StepPrediction {
    bool beside;  // from a boundary of the line itself
  };
  struct Neighbours;
  /// An edge whose boundary was given up.
  struct Doubted {
    int line;
    std::uint32_t edge;
  };
  struct Around {
    std::array<float, 2> column_px{};
    std::size_t count = 0;
    unsigned sources = 0;
  };
  /// What was found on the lines of one range of them.
  struct OfLines {
    std::size_t decoded = 0, still = 0;
    std::vector<Doubted> doubted;
    std::vector<RecoveredBoundary> restored;
    std::size_t added = 0;
  };
  enum class Confirmed { kYes, kNotYet, kNo };
  void fill(int width, const SequenceResult& result, const EdgeImage& edges,
            const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool);
  void fill_line(int line, const SequenceResult& result, const EdgeImage& edges, OfLines& out);
  void measure_pitch();
  void drop_line(const SlideFieldView& view, int line, const EdgeImage& edges, SequenceResult& result);
  Neighbours neighbours(int line, int boundary, float column_px);
  std::array<int, 2> known_beside(int line, int boundary);
  bool is_in_order(int line);
  void put(int line, int boundary, float column_px);
  Around around(int line, int boundary);
  std::optional<Prediction> predict_between(int line, int boundary, const Around& places);
  std::optional<Prediction> predict_beside(int line, int boundary);
  float pitch_beside(int line, int boundary, int side);
  bool fits_before(const SlideFieldView& view, int line, int boundary, const FoundStep& found, bool beside);
  std::optional<FoundStep> look(const SlideFieldView& view, int line, int boundary,
                                const std::optional<Prediction>& p);
  Confirmed confirm(const SlideFieldView& view, const Doubted& doubted, const EdgeImage& edges,
                    const SequenceResult& result, std::vector<RecoveredBoundary>& recovered);
  bool take_back(int line, int boundary, float found_px, const EdgeImage& edges, SequenceResult& result);
  std::size_t grow_line(const SlideFieldView& view, int line, const EdgeImage& edges, SequenceResult& result,
                        std::vector<RecoveredBoundary>& recovered);

  StepFinder steps_;
  Uncovered uncovered_;
  int boundaries_, lines_;
  bool mostly_still_ = false;  // the scene, but for what moves in it
  float pitch_px_ = 0;         // from one boundary to the next, on average
  MovingCells moving_;
  std::vector<std::uint8_t> tried_;  // [line][boundary]: what told its place when it was not found there
  std::vector<float> missed_px_;     // [line][boundary]: beside a boundary of its line it was not found there
  std::vector<std::int32_t> dropped_;   // [line][boundary]: the edge whose boundary was given up, or -1
  std::vector<std::uint8_t> in_order_;  // lines whose boundaries are
  std::vector<Doubted> doubted_;        // that may still be confirmed
  std::vector<OfLines> of_lines_;       // [worker]
  ColumnGrid now_, before_;
};

}  // namespace relievo
