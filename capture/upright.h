// SPDX-License-Identifier: Apache-2.0
// A projector that hangs from the ceiling, or a camera that does, sees the stripes in the opposite order.
// That is the same light as of a projector that stands upright and shows the pattern backwards; what decodes,
// codes and draws surfaces knows only such rigs.
#pragma once

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

/// A rig and the pattern that it shows, of which stripes follow one another from the camera's left to its
/// right.
struct UprightRig {
  Rig rig;
  Pattern pattern;
};

/// With its stripes from right to left: boundary i becomes boundaries() - 1 - i.
Pattern reversed(const Pattern& pattern);

/// The same light, seen so: `rig` and `pattern` as they are, or the projector turned by 180 degrees about its
/// axis and the pattern reversed. For what is projected, use the pattern as it was. Fails where stripes run
/// along the camera's lines rather than across them, so that no line shows a code, and where they run along
/// the baseline, so that codes show no depth.
Result<UprightRig> upright(const Rig& rig, const Pattern& pattern);

}  // namespace relievo
