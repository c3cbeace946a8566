// SPDX-License-Identifier: Apache-2.0
// Whether the exposures of frames are the other way round than is said: of an interlaced camera whose fields
// come in the other order, say. The complement of a code is a code of the pattern, so that surfaces come of
// it, wrong ones; but most of what is read does not fit together.
#pragma once

#include <cstddef>

#include "base/parallel.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/trial_decoder.h"
#include "capture/source/field_source.h"

namespace relievo {

/// One stream's, of two slides and their complements. One thread.
class ExposureDoubt {
 public:
  /// `line_stride` as ReconstructOptions has it.
  ExposureDoubt(const Rig& rig, const Pattern& pattern, int line_stride);

  /// Whether `pair`, of which `report` is, and those before it decode far better with the exposures of each
  /// exchanged. Both ways are tried now and then where little of what is seen is kept.
  bool exchanged(const CapturedFrame& pair, const ReconstructReport& report, WorkerPool& pool);

 private:
  static constexpr int kSoon = 3;  // frames

  bool better_exchanged(const CapturedFrame& pair, WorkerPool& pool) const;

  TrialDecoder trial_;
  CapturedFrame before_;  // the pair before; of no picture where none is wanted
  bool exchanged_ = false;
  int pause_ = kSoon;
  int wait_ = kSoon;  // doubtful frames until it is asked again
};

}  // namespace relievo
