// SPDX-License-Identifier: Apache-2.0
// Which of a frame's exposures shows a single slide (paper 5.5), and which its complement.
// The complement of a code is a code, so that the pictures alone do not tell: but it is out of the slide's
// order, and many times as much of what is read is given up.
#pragma once

#include <cstddef>

#include "base/parallel.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/trial_decoder.h"
#include "capture/source/field_source.h"

namespace relievo {

/// One stream's. One thread.
class ExposureOrder {
 public:
  /// `pattern` must have one slide; `line_stride` as ReconstructOptions has it.
  ExposureOrder(const Rig& rig, const Pattern& pattern, int line_stride);

  /// Whether `pair`, of which `report` is, decodes clearly better with its exposures the other way round.
  /// Tries both ways where that is not known yet, and now and then where much is given up.
  bool exchanged(const CapturedFrame& pair, const ReconstructReport& report, WorkerPool& pool);

 private:
  static constexpr int kSoon = 3;  // frames

  TrialDecoder trial_;
  bool known_ = false;
  int pause_ = kSoon;
  int wait_ = 0;  // doubtful frames until it is asked again
};

}  // namespace relievo
