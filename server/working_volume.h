// SPDX-License-Identifier: Apache-2.0
// The box in which a stream's positions are quantised.
#pragma once

#include <vector>

#include "base/frame3d.h"
#include "codec/frame3d_codec.h"

namespace relievo {

/// Fitted to the first frame with room to move, and grown when a frame leaves it, so that the step of coded
/// positions stays the same from frame to frame. One point in a thousand may lie outside: those are wrong
/// codes, which would otherwise blow the box up for good, and the codec leaves them out. One thread.
class WorkingVolume {
 public:
  /// `fixed` with a size is kept as it is.
  explicit WorkingVolume(const Volume& fixed) : volume_(fixed), fixed_(fixed.size_m > 0) {}

  const Volume& fit(const std::vector<Vec3f>& positions);

  /// Bits that make the step at most `resolution` of the distance to the nearest part of what was seen so
  /// far; 0 where the volume is fixed or nothing was seen.
  int bits(double resolution) const;

 private:
  Volume volume_;
  bool fixed_;
  float distance_m_ = 0;
  std::vector<float> scratch_;
};

}  // namespace relievo
