// SPDX-License-Identifier: Apache-2.0
// Boundaries beside the edges of what moves. A silhouette has moved on between a slide's field and its
// complement's, and further since the other slide's: there the difference of the fields and the other slide
// show two surfaces. The slide's own field shows one, at the frame's own instant; where boundaries on the
// lines around and on the line itself tell which one must be there, it tells whether and where it is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_motion.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// A frame's field under the slide itself, a row a line, the colours on both sides of each boundary of that
/// slide, and the motion between the frame's fields.
struct SlideFieldView {
  View8 field;
  const std::vector<std::array<Primary, 2>>& colours;
  const FieldMotion* motion = nullptr;
};

/// Keeps the frame before and its scratch memory. One thread.
class Growth {
 public:
  /// `colour_matrix` as of the rig: projected RGB = M * captured RGB.
  Growth(const std::array<double, 9>& colour_matrix, int boundaries, int lines);

  /// Adds boundaries that neither `result` nor `recovered` has to `recovered`; what was added leads to more.
  /// What moved into view after the field's instant is given up first. Once a frame. Columns must be those of
  /// the field's instant. Returns how many were added.
  std::size_t grow(const SlideFieldView& view, const EdgeImage& edges, SequenceResult& result,
                   std::vector<RecoveredBoundary>& recovered);

 private:
  /// Where a boundary should be, by what is around it.
  struct Prediction {
    float column_px, sigma_px;
    float left_px, right_px;  // to the nearest boundaries on the line
  };
  struct Found {
    float column_px, sigma_px;
  };
  /// Columns beside a prediction, as the projector's primaries.
  struct Light;
  float* row(std::vector<float>& grid, int line) const;
  void fill(int width, const SequenceResult& result, const EdgeImage& edges,
            const std::vector<RecoveredBoundary>& recovered);
  void drop_line(const SlideFieldView& view, int line, const EdgeImage& edges, SequenceResult& result);
  bool moves(int line, float column_px) const;
  std::optional<Prediction> predict(int line, int boundary);
  void read(const std::uint8_t* pixels, int centre, Light& out) const;
  std::optional<Found> find(const SlideFieldView& view, int line, int boundary, const Prediction& p) const;
  std::size_t grow_line(const SlideFieldView& view, int line, std::vector<RecoveredBoundary>& recovered);

  std::array<float, 9> colour_;
  int boundaries_, lines_;
  std::size_t stride_;
  bool mostly_still_ = false;         // the scene, but for what moves in it
  int cells_ = 0;                     // of a line
  std::vector<std::uint8_t> moving_;  // [line][cell]: something moves near
  std::vector<std::uint8_t> tried_;   // [line][boundary]: what told its place when it was not found there
  std::vector<float> now_, before_;   // [line][boundary] with a margin: column, NaN where there is none
};

}  // namespace relievo
