// SPDX-License-Identifier: Apache-2.0
// The texture of what moves. Where a silhouette or a stripe has gone on between the exposures of a slide and
// of its complement, the two show other things at one place and do not add up to white, but to colours. There
// the slide tells alone: of a primary that a stripe lacks, the stripes beside it on its surface have it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/camera_response.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/four.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/source/field_source.h"

namespace relievo {

/// What a frame was decoded to.
struct ShownStripes {
  const DecodedGrid& grid;                             // where boundaries are at the slide's exposure
  const std::vector<std::array<Primary, 2>>& colours;  // left and right of each under the slide
  const MovingPlaces& moving;
};

/// Keeps its scratch memory from frame to frame. One thread.
class MovingTexture {
 public:
  /// `colour_matrix` is M of Eq. 1 and must have an inverse; `line_stride` that of the grids.
  MovingTexture(const std::array<double, 9>& colour_matrix, const CameraResponse& response,
                int line_stride = 1);

  /// `frame` is in light. `texture`, the fields' sum in the camera's values, RGB, gets the slide's own light
  /// where things move and the complement, times `gains`, shows something else. Rows between lines become
  /// what lies between these there. The same for any number of threads.
  void mend(const CapturedFrame& frame, const ShownStripes& shown, const std::array<float, 3>& gains,
            WorkerPool& pool, Image8& texture);

 private:
  using Light = Four;  // of the projector's primaries, and 0
  /// Between two boundaries next to each other.
  struct Stripe {
    float left_px, right_px;
    int first, last;  // columns where its colour is pure, one at least
    Primary colour;   // under the slide
    bool moves = false;
    bool unlike = false;          // the complement shows something else there
    Light slide{}, complement{};  // there, on average,
    Light white{};                // and what both should show together

    float middle_px() const { return 0.5F * static_cast<float>(first + last); }
  };
  struct Columns {
    int begin, end;
  };
  struct Scratch {
    std::vector<Stripe> stripes;  // of one surface on a line
  };
  /// A line of both exposures.
  struct Exposures;

  Light mean_light(const std::uint8_t* above, const std::uint8_t* below, const Stripe& stripe) const;
  void mend_line(const DetectionLines& rows, const ShownStripes& shown, const Light& gains, int line,
                 Scratch& scratch, Image8& texture);
  void look(const Exposures& exposures, const Light& gains, std::vector<Stripe>& stripes) const;
  void mend_between(const Stripe& a, const Stripe& b, Columns columns, std::uint8_t* texture,
                    std::uint8_t* mended) const;
  void mend_surface(const Exposures& exposures, const Light& gains, std::vector<Stripe>& stripes,
                    std::uint8_t* texture, std::uint8_t* mended) const;
  void mend_rows_behind(int line, Image8& texture) const;

  CameraResponse response_;
  std::array<Four, 3> matrix_, inverse_;  // columns of M and of its inverse
  int line_stride_;
  int width_ = 0;
  int step_ = 1;                      // rows from line to line
  std::vector<std::uint8_t> mended_;  // [line][column]
  std::vector<Columns> touched_;      // [line]: within these some are; empty: none is
  std::vector<Scratch> scratch_;      // one a worker
};

}  // namespace relievo
