// SPDX-License-Identifier: Apache-2.0
// A simulated scene that stands still under any code, with its depth: for comparing decoders on one scene.
#pragma once

#include <string>
#include <vector>

#include "base/image.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/pattern/gray_decode.h"
#include "capture/source/field_source.h"
#include "cli/stop_signal.h"

namespace relievo::bench {

struct StillScene {
  Rig rig;                             // progressive
  Pattern pattern;                     // of the stripes
  std::vector<CapturedFrame> stripes;  // one a slide, each with its complement
  GrayStack gray;
  Image8 white, black;  // grey
  ImageF truth;         // depth in metres, 0 where there is nothing
  /// 1 where the projector lights the scene, as it shows without noise; as many as pixels.
  std::vector<std::uint8_t> lit;
};

/// `spec`: SCENE[,key=value...] as for sim: sources. Errors as theirs. Once stopped, pictures are missing.
Result<StillScene> render_still_scene(const std::string& spec, const StopSignal& stop);

}  // namespace relievo::bench
