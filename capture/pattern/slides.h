// SPDX-License-Identifier: Apache-2.0
// A pattern's slides as pictures for the projector, exact to the pixel (paper 4.1, 5.1).
#pragma once

#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/pattern/schedule.h"

namespace relievo {

/// RGB, 0 or 255: slide `slide` (0..pattern.slides-1), or its complement. A pixel shows the stripe that its
/// centre is in, so boundaries lie where Pattern::boundary_column_px says to half a pixel.
Image8 draw_slide(const Pattern& pattern, int slide, bool complement, int width, int height);

/// The same with the stripes along rows, from top to bottom: they divide the height.
Image8 draw_row_slide(const Pattern& pattern, int slide, bool complement, int width, int height);

/// What one field shows: a slide, its complement, or all white.
Image8 draw_field(const Pattern& pattern, const Exposure& exposure, int width, int height);

/// Interlaced frame 0..cycle_frames()-1 of the pattern's scheme, its two fields on every second row each.
Image8 draw_interlaced(const Pattern& pattern, int frame, FieldOrder order, int width, int height);

}  // namespace relievo
