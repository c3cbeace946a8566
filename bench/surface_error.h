// SPDX-License-Identifier: Apache-2.0
// How far a decoded surface lies from the one that was encoded.
#pragma once

#include "base/frame3d.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo::bench {

struct SurfaceError {
  double rms_m = 0;
  double max_m = 0;
};

/// Over the decoded vertices: the distance to the encoded vertex that it is, which is the one at its place on
/// the grid of stripes and lines, since codecs may permute and leave out vertices. The place of a decoded
/// vertex follows from its position and, where it has them, texture coordinates, whatever grid its codec
/// says; `encoded` must have its grid. Fails where nothing was encoded at a decoded vertex's place.
Result<SurfaceError> surface_error(const Surface& encoded, const Surface& decoded, const Rig& rig,
                                   const Pattern& pattern);

}  // namespace relievo::bench
