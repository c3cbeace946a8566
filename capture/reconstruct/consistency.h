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

/// Keeps its scratch memory from frame to frame. One thread.
class ConsistencyCheck {
 public:
  /// Gives up boundaries of `result` (-1, and those that another frame may confirm are `doubted`), moves
  /// columns of `edges` and updates their standard deviations. Where a line has a boundary twice, the last
  /// counts and the others are given up.
  ConsistencyCounts check(int boundaries, WorkerPool& pool, SequenceResult& result, EdgeImage& edges);

  /// Of what is tolerated in pixels, in the frame checked last: more where stripes are wide. At least 1.
  float scale() const { return scale_; }

 private:
  struct Estimate {
    float column_px;
    float sigma_px;
  };
  float* row(std::vector<float>& grid, int line) const;
  const float* row(const std::vector<float>& grid, int line) const;
  void reset(int boundaries, int lines, int workers);
  void fill_line(const EdgeImage& edges, const SequenceResult& result, int line, int worker);
  void bends_of_line(int line, int worker);
  void smooth_line(int line, float noise_px);
  void suspect_line(int line);
  std::int32_t root(std::int32_t i);
  void join(std::int32_t a, std::int32_t b);
  void join_to_above(int line);
  void measure_pieces(int begin, int end);
  std::int32_t piece_size(std::size_t cell) const;
  std::optional<Estimate> settle(int line, int boundary, const Edge& edge, bool still) const;

  int boundaries_ = 0;
  int lines_ = 0;
  float scale_ = 1;
  std::size_t stride_ = 0;           // of the grids below, which have kMargin more on all sides
  std::vector<float> measured_;      // [line][boundary]: column, NaN where there is none
  std::vector<float> noise_;         // the same: standard deviation that noise alone gives
  std::vector<float> smooth_;        // the same, noise averaged along the boundary
  std::vector<float> trusted_;       // of these, those that no contrast in the scene draws off their place
  std::vector<std::uint8_t> state_;  // [line][boundary]: what the neighbourhood is like (see consistency.cpp)
  std::vector<std::int32_t> piece_, size_;  // [line][boundary]: union-find over connected pieces of surface
  std::vector<int> seams_;                  // each worker's first line there
  RankedSample sigmas_, bends_, gaps_;      // what lines tell, see fill_line() and bends_of_line()
  std::vector<ConsistencyCounts> counts_;   // one a worker
};

}  // namespace relievo
