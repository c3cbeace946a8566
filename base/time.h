// SPDX-License-Identifier: Apache-2.0
// Time stamps are int64 nanoseconds. Capture and publish times are UTC since the Unix epoch (live) or since
// the take's start (offline); durations come from the monotonic clock.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

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

/// UTC as strftime() writes it; by default "2026-01-02T03:04:05Z". `format` yields less than 64 characters.
std::string utc_text(std::int64_t ns, const char* format = "%Y-%m-%dT%H:%M:%SZ");

inline double seconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}
inline double milliseconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-6;
}

}  // namespace relievo
