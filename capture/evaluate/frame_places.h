// SPDX-License-Identifier: Apache-2.0
// When the frames of a take were projected, by their time stamps alone, so that a decoder can be judged by
// it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "capture/source/take_files.h"

namespace relievo {

/// The times between two projected frames that the stamps of a take allow, nanoseconds, the likelier first:
/// what its steps are of frames at about the rig's frame rate; and the usual step, where that is another:
/// every second frame was lost, or the take is not of that frame rate.
std::vector<double> likely_periods_ns(std::span<const TakeStamp> stamps, double frame_rate);

/// Numbers frames by their steps in time. What clocks differ by does not add up.
class FramePlaces {
 public:
  explicit FramePlaces(double period_ns) : period_ns_(period_ns) {}

  /// Of the take's next frame, those counted that were lost; the first one's is 0.
  std::uint64_t next(std::int64_t time_ns);

 private:
  double period_ns_;
  double ahead_ = 0;  // of the places given, periods
  std::optional<std::int64_t> before_ns_;
  std::uint64_t place_ = 0;
};

}  // namespace relievo
