// SPDX-License-Identifier: Apache-2.0
// How far blur draws a zero crossing of colour off its boundary. Where the scene's brightness changes across
// a boundary, the brighter side weighs more in what a low-pass mixes, and colour, which analog video and YUV
// cameras carry at a fraction of luma's bandwidth, crosses zero on the darker side. How bright each side is
// the fields' sum shows, and its luma is not blurred: so the shift can be told and taken back.
#pragma once

#include <array>
#include <cstddef>

#include "base/pattern.h"
#include "capture/reconstruct/colour_shift_rows.h"

namespace relievo {

/// A boundary of a line, with what is known of the stripes around it.
struct ShiftQuery {
  const float* white;                     // DifferenceImage::white_line()
  int width;                              // of it
  float column_px;                        // of the boundary
  std::array<Primary, 2> colours;         // of the stripes to its left and right,
  float left_end_px, right_end_px;        // where these end; far off where that is not known,
  std::array<Primary, 2> beyond_colours;  // and the stripes behind those ends
};

/// Constant; any thread.
class ColourShift {
 public:
  static constexpr std::size_t kBlurs = 7;
  /// Standard deviations of the blur of chroma over luma's that a camera may have.
  static constexpr std::array<float, kBlurs> kBlur_px{0, 0.5F, 0.8F, 1.1F, 1.5F, 2, 2.6F};

  explicit ColourShift(const std::array<double, 9>& colour_matrix);

  /// Where an edge of EdgeFinder is, less where its boundary is, if chroma is blurred by kBlur_px[blur]. 0
  /// within 11 columns of the picture's ends.
  float shift_px(const ShiftQuery& query, std::size_t blur) const;

 private:
  std::array<float, 3> luma_;                       // weights of the difference's channels in luma
  std::array<float, 3> white_;                      // what each of them shows of a grey that the camera sees
  std::array<StripedRow::Kernel, kBlurs> kernels_;  // the blur and the low-pass along a line
  void (*differences_)(const StripedRow& row, std::array<StripedRow::Out, 3>& out);
};

}  // namespace relievo
