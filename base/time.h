// SPDX-License-Identifier: Apache-2.0
// Time stamps are int64 nanoseconds. Capture and publish times are UTC since the Unix epoch (live) or since
// the take's start (offline); durations come from the monotonic clock.
#pragma once

#include <chrono>
#include <cstdint>

namespace relievo {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// UTC, nanoseconds since the Unix epoch.
inline std::int64_t utc_now_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

/// Monotonic, for durations only.
inline std::int64_t steady_now_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

inline double seconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}
inline double milliseconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

}  // namespace relievo
