// SPDX-License-Identifier: Apache-2.0
// What is said about a projector and a camera that are not in step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/stream.h"
#include "capture/reconstruct/step_keeping.h"

namespace relievo {

/// Fed with each frame's report, in order. One thread.
class StepWatch {
 public:
  explicit StepWatch(double frame_rate);

  void add(std::int64_t time_ns, const StepReport& step);

  /// For a person: how many frames are dropped and what to do. Empty while few are.
  const std::string& message() const { return message_; }
  /// Counts so far, the last phase known and the drift (StepDrift).
  const StepStatus& status() const { return status_; }
  /// What to do, whether or not much is dropped. Empty where nothing ever was.
  std::string advice() const;

 private:
  double frame_rate_;
  StepDrift drift_;
  std::optional<float> mixed_phase_;  // the last one of a mixed frame
  std::vector<std::uint8_t> lately_;  // ring, 1: mixed
  std::uint64_t frames_ = 0;
  std::uint64_t mixed_lately_ = 0;
  StepStatus status_;
  std::string message_;
};

}  // namespace relievo
