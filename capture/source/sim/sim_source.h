// SPDX-License-Identifier: Apache-2.0
// The simulated rig as a source of frames, with the exact truth beside them.
#pragma once

#include <memory>
#include <string>

#include "base/image.h"
#include "base/result.h"
#include "capture/source/field_source.h"

namespace relievo {

/// A FieldSource that knows what it filmed.
class SimSource : public FieldSource {
 public:
  /// Depth along the camera's z in metres (height x width, one channel, 0 = none) of the frame that next()
  /// gave last; empty unless asked for and before the first frame. Valid until the next call of next().
  virtual const ImageF& truth() const = 0;
};

struct SimRun {
  bool loop = false;   // start again at the end, without a jump
  bool truth = false;  // keep the truth beside the frames
  int threads = 0;     // that render; 0: one a core
};

/// spec: "SCENE[,key=value...]", see sim::sim_options_help(). Unlooped, frames are rendered a few ahead.
/// Looped, one period is rendered once and then played from memory (up to 1 GiB; anew each time beyond that);
/// the first frame is held back until the rest of the first pass is sure to keep ahead of playback at the
/// rig's frame rate. Errors name the scene, key or value.
Result<std::unique_ptr<SimSource>> make_sim(const std::string& spec, const SimRun& run);

/// The row of the source table: sim:SCENE[,key=value...].
Result<std::unique_ptr<FieldSource>> open_sim(const std::string& spec, const SourceOptions& options);

/// Whether scene, keys and values are such; opens nothing.
Status check_sim(const std::string& spec);

}  // namespace relievo
