// SPDX-License-Identifier: Apache-2.0
// One frame of the exposures of two, where the projector is an exposure ahead of the camera.
#pragma once

#include "capture/source/field_source.h"

namespace relievo {

/// A frame of the last one's second exposure and this one's first. `before` is the last one's picture where
/// it is interlaced, else its second one. Number, time and `lost_before` of `out` are left as they are.
void join_exposures(const Image8& before, const CapturedFrame& now, CapturedFrame& out);

}  // namespace relievo
