// SPDX-License-Identifier: Apache-2.0
// Frames in less detail, for the lower rungs of the quality ladder (base/rung.h). Pure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/frame3d.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// The vertices of every second line of a surface on the grid of stripes and lines, unchanged but for their
/// line's number, which is half of what it was: the result lies on the grid of a picture with lines twice as
/// far apart (FrameEncoder's `line_stride` 2). A cell of it has the triangles that the two cells it covers
/// have, so that no step or hole is bridged. Second places (GridPoint::line from `lines`, the picture's, on)
/// and the triangles on them are left out: they are a few, at rims, that half the detail does without. False,
/// and nothing in `out`, where there is no such grid. Uses the memory of `out`.
bool halve_lines(const Surface& surface, int lines, Surface& out);

/// The same of a grid in place, which then is not `twice` either; its diagonals aside, which are not chosen
/// anew; and of `planes` that lie in memory as its columns do and are not empty.
void halve_lines(StripeGrid& grid, std::span<std::vector<std::uint8_t>* const> planes = {});

/// Half the width and height, each pixel the mean of four, halves rounded up. A side of an odd length stays
/// as it is, so that texture coordinates hold. Uses the memory of `out` where its size is right.
void halve(const Image8& picture, Image8& out);

}  // namespace relievo
