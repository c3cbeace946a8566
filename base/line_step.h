// SPDX-License-Identifier: Apache-2.0
// How far detection lines lie apart.
#pragma once

#include "base/rig.h"

namespace relievo {

/// Rows of the camera from one detection line to the next, where one row in `stride` of a progressive picture
/// or of a field is a line.
inline int line_step_px(Scan scan, int stride = 1) {
  return (scan == Scan::kInterlaced ? 2 : 1) * stride;
}

}  // namespace relievo
