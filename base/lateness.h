// SPDX-License-Identifier: Apache-2.0
// How long messages wait in queues on their way, told from two clocks that need not agree.
#pragma once

#include <cstdint>
#include <limits>

namespace relievo {

/// Compares each message's way with the shortest one of the last half minute to a minute: what is more is
/// queues. So a constant difference between the two clocks is of no matter, and one that drifts, or jumps, is
/// soon. One thread.
class Lateness {
 public:
  /// `now_ns`: monotonic. `way_ns`: received less sent, each by its own clock. What the message waited.
  std::int64_t add(std::int64_t now_ns, std::int64_t way_ns);

  static constexpr std::int64_t kRemembered_ns = 30'000'000'000;

 private:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::max();
  std::int64_t since_ns_ = 0;
  std::int64_t shortest_ns_ = kNone;  // since then,
  std::int64_t before_ns_ = kNone;    // and in the time before
};

}  // namespace relievo
