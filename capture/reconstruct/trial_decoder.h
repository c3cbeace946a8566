// SPDX-License-Identifier: Apache-2.0
// Frames decoded on trial, as they are and with their exposures exchanged: by the quick decoder, which tells
// as clearly as the others which is right.
#pragma once

#include <initializer_list>

#include "base/parallel.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"

namespace relievo {

/// A copy of `pair` whose second exposure counts as its first.
CapturedFrame exchanged_pair(const CapturedFrame& pair);

/// Keeps nothing from one trial to the next. One thread.
class TrialDecoder {
 public:
  /// `line_stride` as ReconstructOptions has it.
  TrialDecoder(const Rig& rig, const Pattern& pattern, int line_stride);

  /// The report of the last of these successive frames, which are as many as the pattern has slides.
  ReconstructReport decode(std::initializer_list<const CapturedFrame*> pairs, WorkerPool& pool) const;

 private:
  Rig rig_;
  Pattern pattern_;
  ReconstructOptions options_;
};

}  // namespace relievo
