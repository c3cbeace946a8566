// SPDX-License-Identifier: Apache-2.0
// Somebody who looks at single frames of a running pipeline, between reconstruction and encoding.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/frame3d.h"
#include "base/stream.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Copies: the pipeline has gone on.
struct TappedFrame {
  CapturedFrame captured;                // as the source gave it
  std::optional<CapturedFrame> decoded;  // as Reconstructor::decoded()
  std::vector<GridPoint> grid;           // of its surface; empty where it gave none
  ReconstructReport report;
  StepStatus step;
  std::string step_advice;  // empty where projector and camera are in step
  bool calibrated = true;   // false: the rig is a guess
};

/// Called on the pipeline's reconstructing thread: both must return at once.
class FrameTap {
 public:
  virtual ~FrameTap() = default;
  /// Whether this frame, which gave a surface or did not, is to be copied and put.
  virtual bool wants(bool has_surface) = 0;
  virtual void put(TappedFrame&& frame) = 0;
};

}  // namespace relievo
