// SPDX-License-Identifier: Apache-2.0
// What is said about a projector and a camera that are not in step, or whose exposures are taken the wrong
// way round.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/pattern.h"
#include "base/rig.h"
#include "base/stream.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/step_keeping.h"

namespace relievo {

/// Fed with each frame's report, in order. One thread.
class StepWatch {
 public:
  StepWatch(const Pattern& pattern, const Rig& rig);

  void add(std::int64_t time_ns, const ReconstructReport& report);

  /// For a person: how many frames are dropped and what to do. Empty while few are. Under white-frame, whose
  /// exposures are not kept in step, that white frames are missing. Before all, what exchanged() tells.
  const std::string& message() const { return exchanged_ > 0 ? exchange_advice_ : message_; }
  /// Since this many decoded frames they decode far better with their exposures exchanged.
  std::uint64_t exchanged() const { return exchanged_; }
  const std::string& exchange_advice() const { return exchange_advice_; }
  /// Counts so far, the last phase known and the drift (StepDrift).
  const StepStatus& status() const { return status_; }
  /// What to do, whether or not much is dropped. Empty where nothing ever was.
  std::string advice() const;

 private:
  void add(std::int64_t time_ns, const StepReport& step);
  void look_for_white(bool white);

  double frame_rate_;
  std::string exchange_advice_;
  std::uint64_t exchanged_ = 0;
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
