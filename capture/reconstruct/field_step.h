// SPDX-License-Identifier: Apache-2.0
// A boundary in the field of the slide alone: the step between the colours of its two stripes, and the
// colours themselves. One field shows one surface at each place, whatever moves.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "capture/reconstruct/slide_field.h"

namespace relievo {

/// Where a boundary should be, by what is around it.
struct StepPrediction {
  float column_px, sigma_px;
  float left_px, right_px;  // to the nearest boundaries on the line
};

struct FoundStep {
  float column_px, sigma_px;
  float moved_px;  // from the prediction
};

/// Where a field has a boundary by itself.
struct FieldPlace {
  float column_px, sigma_px;
};

/// Immutable.
class StepFinder {
 public:
  /// Light around in which each primary is somewhere at its brightest: columns nearer than that to the
  /// picture's sides are not looked at.
  static constexpr int kReach_px = 14;
  static constexpr float kLeastRoom_px = 3.F;  // to the next boundary
  static constexpr float kOpen_px = 12.F;      // where there is none

  /// `colour_matrix` as of the rig: projected RGB = M * captured RGB.
  explicit StepFinder(const std::array<double, 9>& colour_matrix);

  /// Nothing where the line has no such step near the prediction, or its sides are of other colours. Where a
  /// surface ends beside the boundary, what is seen of that side next to it suffices.
  std::optional<FoundStep> find(const SlideFieldView& view, int line, int boundary,
                                const StepPrediction& p) const;

  /// Where near a place the light is as much of the boundary's left colour as of its right one, however
  /// bright the surface is on either side. `left_px` and `right_px` as of StepPrediction.
  std::optional<FieldPlace> balance(const SlideFieldView& view, int line, int boundary, float column_px,
                                    float left_px, float right_px) const;

  /// True where the sides of a place are of other colours than the boundary's; false where that cannot be
  /// told. `left_px` and `right_px` as of StepPrediction.
  bool shows_another(const SlideFieldView& view, int line, int boundary, float column_px, float left_px,
                     float right_px) const;

 private:
  struct Light;
  struct Rise;
  void read(const SlideFieldView& view, int line, int centre, Light& out) const;
  static std::optional<Rise> steepest(const Light& light, const std::array<Primary, 2>& colours,
                                      float predicted_px);

  std::array<float, 9> colour_;
};

}  // namespace relievo
