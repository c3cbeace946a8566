// SPDX-License-Identifier: Apache-2.0
// How much care frames are decoded with so that all of a camera's are (`--decoder auto`): less where frames
// are dropped for want of time, more again where there would be time for it.
#pragma once

#include <cstdint>
#include <string>

#include "base/quality_choice.h"
#include "capture/reconstruct/reconstructor.h"

namespace relievo {

struct Pace {
  Decoder decoder;
  int line_stride;  // of the rig's detection lines

  bool operator==(const Pace&) const = default;
};
/// For people: "quick, every second line".
std::string to_string(const Pace& pace);

/// One thread. Pure: the same times give the same paces.
class PaceControl {
 public:
  /// `lines`: the camera's detection lines, of which enough are to be left to see what is there.
  explicit PaceControl(int lines);

  /// A frame was reconstructed at now() in `ms`, after so many others were dropped for want of time.
  /// `now_ns`: monotonic.
  void add(std::int64_t now_ns, double ms, std::uint64_t dropped);
  /// For the next frame.
  Pace now() const;
  /// Whether that is the least care there is.
  bool at_least() const;

 private:
  QualityChoice choice_;
  Rung least_ = Rung::kFull;
};

}  // namespace relievo
