// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "capture/reconstruct/field_motion.h"

namespace relievo {

class MovingPlaces;

/// A frame's field under the slide itself, a row a line, the colours on both sides of each boundary of that
/// slide, the motion between the frame's fields, which of the two slides it is, the standard deviation of the
/// frame's DifferenceImage, where something moves, and the share of ambient light, 0..1, in what is lit.
struct SlideFieldView {
  View8 field;
  const std::vector<std::array<Primary, 2>>& colours;
  const FieldMotion* motion = nullptr;
  int slide = 0;
  float noise = 0;
  const MovingPlaces* moving = nullptr;
  float ambient = 0;
};

}  // namespace relievo
