// SPDX-License-Identifier: Apache-2.0
// Boundaries at one instant. A boundary is found where slide and complement balance: half way between their
// exposures, a quarter of a frame after the frame's time stamp. Where it was in the frame before tells how
// fast it moves, and so where it was at the time stamp; where nothing moves, it averages noise.
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_motion.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Of the frame whose boundaries are given.
struct FrameInstant {
  std::int64_t time_ns;
  const FieldMotion& motion;
};

/// Remembers where the last frame had its boundaries. One thread.
class InstantFilter {
 public:
  /// `frame_ns` is the time from one frame to the next.
  InstantFilter(int boundaries, int lines, double frame_ns);

  /// Moves columns of `edges` and `recovered` to the frame's time stamp, where the boundary was seen in the
  /// frame before, too, and moved no more than its neighbours, or else by its motion between the fields;
  /// updates standard deviations.
  void adjust(const FrameInstant& frame, const SequenceResult& result, EdgeImage& edges,
              std::vector<RecoveredBoundary>& recovered, WorkerPool& pool);

  /// The same of what a check left, by the frame before alone, to `out`.
  void adjust(std::int64_t time_ns, ConsistencyCheck& checked, WorkerPool& pool, PlaceGrid& out);

 private:
  struct Seen {
    float column_px;
    float sigma_px;  // infinite where there is none
  };
  Seen* row(std::vector<Seen>& grid, int line) const;
  void fill(const SequenceResult& result, const EdgeImage& edges,
            const std::vector<RecoveredBoundary>& recovered, WorkerPool& pool);
  /// From the frame before to the time stamp of this one.
  struct Step {
    float share;        // of the motion to here, to be taken back
    float expected_px;  // that motion, by what moves between the frame's fields
  };
  /// What a frame's boundaries are adjusted by.
  struct ByTime {
    double frames;  // since the frame before
    bool before;    // which is recent enough
    float share;    // of the motion since then, to be taken back
  };
  ByTime by_time(std::int64_t time_ns) const;
  void adjust_one(const ByTime& by, const FieldMotion& motion, int line, int boundary, float& column_px,
                  float& sigma_px);
  void end_frame(std::int64_t time_ns);
  bool adjust_by_before(int line, int boundary, const Step& step, float& column_px, float& sigma_px);

  int boundaries_, lines_;
  double frame_ns_;
  std::size_t stride_;
  std::int64_t before_ns_ = 0;
  bool have_before_ = false;
  std::vector<Seen> now_, before_;                  // [line][boundary] with a margin of one
  std::vector<float> before_px_, before_sigma_px_;  // of a check's rows, as they lie there
  std::vector<std::vector<float>> moved_;           // a line's columns and standard deviations, one a worker
};

}  // namespace relievo
