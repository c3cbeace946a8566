// SPDX-License-Identifier: Apache-2.0
// Time stamps of drivers as UTC.
#pragma once

#include <cstdint>
#include <optional>

namespace relievo::v4l2 {

/// Drivers stamp with the monotonic clock, or with one of their own, which may jump. One thread.
class DriverClock {
 public:
  /// Both clocks read at one moment.
  DriverClock(std::int64_t monotonic_ns, std::int64_t utc_ns)
      : utc_from_monotonic_ns_(utc_ns - monotonic_ns) {}

  /// `stamp_ns`: the driver's; `now_ns`: CLOCK_MONOTONIC when the buffer was taken.
  std::int64_t to_utc(std::int64_t stamp_ns, bool monotonic, std::int64_t now_ns);

 private:
  const std::int64_t utc_from_monotonic_ns_;
  std::optional<std::int64_t> anchor_ns_;  // monotonic - the driver's own clock
};

}  // namespace relievo::v4l2
