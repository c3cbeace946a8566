// SPDX-License-Identifier: Apache-2.0
// The system's clock may be set while a program runs, as a machine's that starts without the time; the
// monotonic clock goes on evenly.
#pragma once

#include <cstdint>

namespace relievo {

/// What has to be added to monotonic times for UTC: the same from its creation on, until somebody sets the
/// clock by more than 10 ms. (A time server that slows the clock down or speeds it up does so to both.) One
/// thread.
class ClockSteps {
 public:
  ClockSteps();
  /// Looks at both clocks.
  std::int64_t utc_from_steady_ns();
  /// By how much it has been set since the creation: what has to be added to UTC times that were made of the
  /// monotonic clock and how both were then. Looks at both clocks.
  std::int64_t set_by_ns() { return utc_from_steady_ns() - begun_ns_; }

 private:
  std::int64_t begun_ns_ = 0, now_ns_ = 0;  // UTC less the monotonic clock
};

}  // namespace relievo
