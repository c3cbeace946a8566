// SPDX-License-Identifier: Apache-2.0
// A pattern's slides as pictures for the projector, exact to the pixel (paper 4.1, 5.1).
#pragma once

#include "base/image.h"
#include "base/pattern.h"

namespace relievo {

/// RGB, 0 or 255: slide `slide` (0..pattern.slides-1), or its complement. A pixel shows the stripe that its
/// centre is in, so boundaries lie where Pattern::boundary_column_px says to half a pixel.
Image8 draw_slide(const Pattern& pattern, int slide, bool complement, int width, int height);

/// The same with the stripes along rows, from top to bottom: they divide the height.
Image8 draw_row_slide(const Pattern& pattern, int slide, bool complement, int width, int height);

/// One interlaced frame: the slide on the even rows, its complement on the odd ones.
Image8 draw_interlaced(const Pattern& pattern, int slide, int width, int height);

}  // namespace relievo
