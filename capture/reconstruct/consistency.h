// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries against the surface they lie on. Seen as columns over (line, boundary), a surface is
// smooth: along a boundary over a few lines more so than noise is, so noise is averaged away; and up to a
// depth step, beside which edges are drawn towards it by blur or are the step's own, so there a boundary is
// put back on the surface that its neighbours on the same side of the step show, or given up.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Every count is of decoded boundaries.
struct ConsistencyCounts {
  std::size_t rejected = 0;  // that no surface passes through
  std::size_t moved = 0;     // beside a step, put back on the surface
};

/// A line's boundaries, from the pattern's first to its last.
struct BoundaryRow {
  // Of `marks`.
  static constexpr std::uint8_t kStill = 1;  // in the last frame under the same slide it was where it is
  static constexpr std::uint8_t kAtStep = 2, kAboveDiffers = 4, kBelowDiffers = 8;  // as Edge has them
  static constexpr std::uint8_t kPlain = 16;  // the scene has no contrast there
  static constexpr float kPlainContrast = 0.05F;
  static constexpr std::uint8_t kDoubted = 32;  // given up, but another frame may confirm it

  float* column_px;  // NaN: the line does not have it
  float* sigma_px;   // standard deviation,
  float* noise_px;   // and the part of it that is noise; 0 where there is no boundary
  std::uint8_t* marks;
};

/// Keeps its scratch memory from frame to frame. One thread, but where it is said.
class ConsistencyCheck {
 public:
  static constexpr int kMargin = 3;

  /// Gives up boundaries of `result` (-1, and those that another frame may confirm are `doubted`), moves
  /// columns of `edges` and updates their standard deviations. Where a line has a boundary twice, the last
  /// counts and the others are given up.
  ConsistencyCounts check(int boundaries, WorkerPool& pool, SequenceResult& result, EdgeImage& edges);

  /// The same of boundaries that lie in rows already. First this; then every line's row is filled, by any
  /// worker, and shown() is called for it; then settle().
  /// One line in `every` tells what all have in common.
  void begin(int boundaries, int lines, WorkerPool& pool, int every = 1);
  /// As it was before: all of it must be overwritten. Of any thread.
  BoundaryRow row(int line);
  void shown(int line, int worker);
  /// Moves and gives up.
  ConsistencyCounts settle(WorkerPool& pool);
  int lines() const { return lines_; }
  /// Columns as settle() leaves them, NaN: given up. Standard deviations are in the line's row. Around them
  /// are kMargin lines and places that hold nothing; a row can be read and written in eights.
  float* settled_px(int line) { return row(settled_, line); }

  /// From a line's row to the next one.
  std::size_t stride() const { return stride_; }

  /// Of what is tolerated in pixels, in the frame checked last: more where stripes are wide. At least 1.
  float scale() const { return scale_; }
  /// In the frame checked last columns scattered over lines as no noise does: by a texture finer than pixels.
  bool speckled() const { return speckle_px_ > 0; }

 private:
  struct Estimate {
    float column_px;
    float sigma_px;
  };
  float* row(std::vector<float>& grid, int line) const;
  const float* row(const std::vector<float>& grid, int line) const;
  std::uint8_t* bytes(std::vector<std::uint8_t>& grid, int line) const;
  const std::uint8_t* bytes(const std::vector<std::uint8_t>& grid, int line) const;
  void reset(int boundaries, int lines, int workers);
  void fill_line(const EdgeImage& edges, const SequenceResult& result, int line, int worker);
  void add_gaps(int line, int worker);
  void bends_of_line(int line, int worker);
  void smooth_line(int line, float noise_px);
  void suspect_line(int line);
  void settle_line(int line, ConsistencyCounts& counts);
  std::int32_t root(std::int32_t i);
  void join(std::int32_t a, std::int32_t b);
  void join_to_above(int line);
  void measure_pieces(int begin, int end);
  std::int32_t piece_size(std::int32_t cell) const;
  std::optional<Estimate> settle(int line, int boundary, float sigma_px, std::uint8_t marks) const;

  int boundaries_ = 0;
  int lines_ = 0;
  int every_ = 1;
  float scale_ = 1;
  float speckle_px_ = 0;             // scatter over lines that no model of noise foretells; 0: there is none
  std::size_t stride_ = 0;           // of the grids below, which have kMargin more on all sides
  std::vector<float> measured_;      // [line][boundary]: column, NaN where there is none
  std::vector<float> noise_;         // the same: standard deviation that noise alone gives
  std::vector<float> sigma_;         // the same: standard deviation
  std::vector<float> settled_;       // the same: column in the end
  std::vector<float> smooth_;        // the same, noise averaged along the boundary
  std::vector<float> trusted_;       // of these, those that no contrast in the scene draws off their place
  std::vector<std::uint8_t> marks_;  // [line][boundary, padded]: BoundaryRow's
  std::vector<std::uint8_t> state_;  // the same: Neighbourhood's
  std::vector<std::int32_t> piece_, size_;  // [line][boundary]: union-find over connected pieces of surface
  std::vector<int> seams_;                  // each worker's first line there
  RankedSample sigmas_, bends_, gaps_;      // what lines tell, see shown() and bends_of_line()
  std::vector<ConsistencyCounts> counts_;   // one a worker
};

}  // namespace relievo
