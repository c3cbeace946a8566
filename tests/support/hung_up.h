// SPDX-License-Identifier: Apache-2.0
// The same light by a projector that hangs from the ceiling.
#pragma once

#include "base/rig.h"

namespace relievo::test {

/// `rig` with the projector turned by 180 degrees about its axis. Of a lens without tangential distortion.
inline Rig hung_up(Rig rig) {
  for (std::size_t i = 0; i < 6; ++i) rig.projector_from_camera_rotation[i] *= -1;  // x and y
  for (std::size_t i = 0; i < 2; ++i) rig.projector_from_camera_translation[i] *= -1;
  rig.projector.matrix[2] = rig.projector.width - 1 - rig.projector.cx();
  rig.projector.matrix[5] = rig.projector.height - 1 - rig.projector.cy();
  return rig;
}

}  // namespace relievo::test
