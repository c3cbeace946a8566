// SPDX-License-Identifier: Apache-2.0
// How far a decoded surface lies from the one that was encoded.
#pragma once

#include "base/frame3d.h"
#include "base/result.h"

namespace relievo::bench {

struct SurfaceError {
  double rms_m = 0;
  double max_m = 0;
};

/// Over the decoded vertices: the distance to the encoded vertex that it is, which is the one nearest in the
/// texture, since codecs may permute and leave out vertices. Both need texture coordinates. Fails where a
/// vertex has no counterpart within two pixels of a 1024 pixel texture: it was never encoded.
Result<SurfaceError> surface_error(const Surface& encoded, const Surface& decoded);

}  // namespace relievo::bench
