// SPDX-License-Identifier: Apache-2.0
// How far detection lines lie apart.
#pragma once

#include "base/rig.h"

namespace relievo {

/// Rows of the camera from one detection line to the next; of a progressive camera one row in `stride` is a
/// line.
inline int line_step_px(Scan scan, int stride = 1) {
  return scan == Scan::kInterlaced ? 2 : stride;
}

}  // namespace relievo
