// SPDX-License-Identifier: Apache-2.0
// Unsure places against the picture that they would give. Beside a rim or on texture, what blurs colour along
// a line and what keeps noise out across lines mix a boundary's stripes with the next surface's, and every
// place read off a mixture is off its own. Luma is not blurred, so how bright each pixel is, is known; which
// colours a boundary separates is known, too: so is what the camera shows where the boundary is at a place,
// and the place at which that comes nearest to what it did show is the boundary's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/render_rows.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// The frame's places, all of one instant, and what is known of how it shows them.
struct RenderView {
  const DetectionLines& rows;
  const std::vector<std::array<Primary, 2>>& colours;  // of each boundary, left and right
  PlaceGrid& places;                                   // follows what changes
  const MovingPlaces& moving;
  float blur_px = 1;  // standard deviation of the blur of chroma over luma's
  float ambient = 0;  // share of ambient light, 0..1, in what is lit
};

/// Every count is of boundaries.
struct RenderCounts {
  std::size_t moved = 0;
  std::size_t rejected = 0;
  std::size_t restored = 0;
};

/// Keeps its scratch memory from frame to frame. One thread.
class RenderPlacer {
 public:
  /// `colour_matrix` must have an inverse: pictures are as the camera gives them.
  explicit RenderPlacer(const std::array<double, 9>& colour_matrix);

  /// Moves unsure places of `edges` and `recovered` and updates their standard deviations; gives up
  /// boundaries of `result` (-1), and takes them out of `recovered`, that the picture does not show; and,
  /// where things hold still, adds boundaries to `recovered` that were given up, or that a line beside has,
  /// and that it does show. Not for frames in which much moves: their two fields show different surfaces.
  RenderCounts place(const RenderView& view, WorkerPool& pool, SequenceResult& result, EdgeImage& edges,
                     std::vector<RecoveredBoundary>& recovered);

 private:
  struct Found {
    float off_px, sigma_px;
    float unlike;  // 0..3, a column: the picture there and what is shown
    float gain;    // the same, how much more without a boundary
    float lit;     // 0..1: share of the projector's light that its darker side has
  };

  bool look(const RenderView& view, int line, int boundary, float column_px, Found& out) const;
  static Place weighed(float column_px, float sigma_px, const Found& found);
  float doubt(float sigma_px, const Found& found) const;
  bool settle(const RenderView& view, int line, int boundary, int worker, float& column_px, float& sigma_px);
  struct Candidate {
    int line, boundary;
    float column_px, sigma_px;
  };
  bool restore(const RenderView& view, const Candidate& candidate,
               std::vector<RecoveredBoundary>& recovered) const;
  std::size_t restore_line(const RenderView& view, int line, const SequenceResult& result,
                           const EdgeImage& edges, std::vector<RecoveredBoundary>& recovered) const;

  std::array<std::array<float, 3>, 3> seen_;  // [captured channel][primary]
  std::array<float, 2 * RenderedRow::kBlurReach + 1> blur_{};
  float (*unlike_)(const RenderedRow& row, float column_px);
  std::vector<RenderCounts> counts_;   // one a worker
  std::vector<std::uint8_t> dropped_;  // one each of `recovered`
  RankedSample unlikes_;
  float usual_ = 0.6F;  // Found::unlike in the frame before: no camera is quite as it is taken to be
};

}  // namespace relievo
