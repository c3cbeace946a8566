// SPDX-License-Identifier: Apache-2.0
// A camera's frames into surfaces, with as much care as this machine keeps up with, or as it was told.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "base/result.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "server/pace.h"

namespace relievo {

/// One thread, but for what says that any may.
class PacedReconstructor {
 public:
  struct Options {
    std::string label{};  // before its lines in the log
    ReconstructOptions reconstruct;
    bool auto_pace = false;  // decoder and lines change so that none of the frames is dropped (pace.h)
  };
  /// `reconstructor`: as the options have it, to begin with. `source` must outlive this.
  PacedReconstructor(const SourceInfo& source, Options options, Reconstructor reconstructor);

  /// Another one after took() has changed the pace.
  Reconstructor& now() { return reconstructor_; }
  /// After `frame`, which took its thread `ms`: `dropped` have been in all, for want of time. What comes next
  /// has another pace where that suits better; where the pace is not to be chosen here, the log says once
  /// that frames are dropped for more than a moment. Fails as Reconstructor does.
  Status took(const CapturedFrame& frame, double ms, std::uint64_t dropped);

  /// Any thread.
  Pace pace() const;
  /// As Reconstructor::recycle(), of any thread.
  void recycle(Frame3D&& used);

 private:
  Status change_to(const Pace& pace, const CapturedFrame& frame);
  void say_behind(std::uint64_t dropped);

  const SourceInfo& source_;
  const Options options_;
  PaceControl control_;
  DropWatch drops_;            // where the pace is not chosen here
  std::uint64_t dropped_ = 0;  // when one of the two was told last
  bool said_behind_ = false;

  mutable std::mutex mutex_;  // changes what follows
  Reconstructor reconstructor_;
  Pace pace_;
};

}  // namespace relievo
