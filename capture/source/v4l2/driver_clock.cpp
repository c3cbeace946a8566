// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/driver_clock.h"

#include <algorithm>

namespace relievo::v4l2 {
namespace {

constexpr std::int64_t kPlausible_ns =
    5'000'000'000;  // a buffer that waited for longer is none of a live rig
constexpr std::int64_t kJump_ns = 1'000'000'000;

/// |a - b| <= limit, whatever a driver's stamp is.
bool near(std::int64_t a, std::int64_t b, std::int64_t limit) {
  std::int64_t difference = 0;
  return !__builtin_sub_overflow(a, b, &difference) && difference <= limit && difference >= -limit;
}

}  // namespace

std::int64_t DriverClock::to_utc(std::int64_t stamp_ns, bool monotonic, std::int64_t now_ns) {
  // No exposure is later than its buffer; all that came after such a stamp would have to follow it.
  if (monotonic && near(now_ns, stamp_ns, kPlausible_ns))
    return std::min(stamp_ns, now_ns) + utc_from_monotonic_ns_;
  // now = stamp + anchor, all modulo 2^64: a stamp may be anything.
  const auto sum = [](std::int64_t a, std::int64_t b) {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
  };
  if (!anchor_ns_ || !near(sum(stamp_ns, *anchor_ns_), now_ns, kJump_ns))
    anchor_ns_ =
        static_cast<std::int64_t>(static_cast<std::uint64_t>(now_ns) - static_cast<std::uint64_t>(stamp_ns));
  return std::min(sum(stamp_ns, *anchor_ns_), now_ns) + utc_from_monotonic_ns_;
}

}  // namespace relievo::v4l2
