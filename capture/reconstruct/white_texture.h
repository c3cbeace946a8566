// SPDX-License-Identifier: Apache-2.0
// The scene as white light would show it, free of what adding the two fields (texture.h) leaves of the
// stripes: where a field's rows are missing, they come from the row that belongs to the same surface instead
// of from both; and where the projector's complement is not as bright as its slide, its colours are brought
// level.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "capture/camera_response.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class WhiteTexture {
 public:
  /// `colour_matrix` is M of Eq. 1. `quickly`: by fewer boundaries, and where nothing is to be brought level
  /// by adding the fields. `line_stride` is that of the grids, as in ReconstructOptions.
  WhiteTexture(const std::array<double, 9>& colour_matrix, const CameraResponse& response,
               bool quickly = false, int line_stride = 1);

  /// RGB, the size of the camera's picture, in the camera's values, which saturate at 255. Across each
  /// boundary of `grid`, what the slide loses of a primary its complement gains, so they tell how bright one
  /// is by the other. `out` is reused where its size fits.
  void make(const SeenFrame& frame, const DecodedGrid& grid, WorkerPool& pool, Image8& out);

  /// What the complement's calibrated red, green and blue were multiplied by in the last frame.
  const std::array<float, 3>& gains() const { return gains_; }

 private:
  struct Scratch {
    std::vector<std::int16_t> above, below;  // [3 width + 2]: how much the field's own rows differ
    std::vector<float> own, other, beside;   // [3 width]
    std::vector<std::uint8_t> differences;   // as weave_rows() asks for
  };
  void measure_gains(const CapturedFrame& frame, const DecodedGrid& grid, WorkerPool& pool);
  void measure_ratios(const DetectionLines& rows, const DecodedGrid& grid, int line, int worker);
  void level(float* row, int width) const;
  void store_sum(const Scratch& scratch, int samples, std::uint8_t* to) const;
  void progressive_row(const CapturedFrame& frame, int y, Scratch& scratch, Image8& out) const;
  void interlaced_row(const CapturedFrame& frame, int y, Scratch& scratch, Image8& out) const;

  CameraResponse response_;
  std::array<float, 9> matrix_;
  std::array<float, 9> inverse_;
  std::array<float, 9>
      levelled_{};  // of captured colours, those of the complement made as bright as the slide's
  std::array<float, 3> gains_{1, 1, 1};
  bool level_ = false;
  int line_stride_;
  bool quickly_;
  int every_;  // boundaries looked at
  std::vector<Scratch> scratch_;
  std::array<RankedSample, 3> ratios_;  // of each primary, at boundaries
};

}  // namespace relievo
