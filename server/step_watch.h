// SPDX-License-Identifier: Apache-2.0
// What is said about a projector and a camera that are not in step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/pattern.h"
#include "base/stream.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/step_keeping.h"

namespace relievo {

/// Fed with each frame's report, in order. One thread.
class StepWatch {
 public:
  /// Of a pattern and a camera's frames a second.
  StepWatch(const Pattern& pattern, double frame_rate);

  void add(std::int64_t time_ns, const ReconstructReport& report);

  /// For a person: how many frames are dropped and what to do. Empty while few are. Under white-frame, whose
  /// exposures are not kept in step, that white frames are missing.
  const std::string& message() const { return message_; }
  /// Counts so far, the last phase known and the drift (StepDrift).
  const StepStatus& status() const { return status_; }
  /// What to do, whether or not much is dropped. Empty where nothing ever was.
  std::string advice() const;

 private:
  void add(std::int64_t time_ns, const StepReport& step);
  void look_for_white(bool white);

  double frame_rate_;
  std::uint64_t white_every_;        // frames; 0: none is white
  std::uint64_t without_white_ = 0;  // frames since the last white one
  StepDrift drift_;
  std::optional<float> mixed_phase_;  // the last one of a mixed frame
  std::vector<std::uint8_t> lately_;  // ring, 1: mixed
  std::uint64_t frames_ = 0;
  std::uint64_t mixed_lately_ = 0;
  StepStatus status_;
  std::string message_;
};

}  // namespace relievo
