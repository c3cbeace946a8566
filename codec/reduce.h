// SPDX-License-Identifier: Apache-2.0
// Frames in less detail, for the lower rungs of the quality ladder (base/rung.h). Pure.
#pragma once

#include "base/frame3d.h"

namespace relievo {

/// The vertices of every second line of a surface on the grid of stripes and lines, unchanged but for their
/// line's number, which is half of what it was: the result lies on the grid of a picture with lines twice as
/// far apart (FrameEncoder's `line_stride` 2). A cell of it has the triangles that the two cells it covers
/// have, so that no step or hole is bridged. False, and nothing in `out`, where there is no such grid.
bool halve_lines(const Surface& surface, Surface& out);

/// Half the width and height, each pixel the mean of four. A side of an odd length stays as it is, so that
/// texture coordinates hold.
Image8 halve(const Image8& picture);

}  // namespace relievo
