// SPDX-License-Identifier: Apache-2.0
// Which rung of the quality ladder a receiver should be on, from what it measures of itself. Used by DDS
// clients for themselves and by the gateway for each of its clients.
#pragma once

#include <cstdint>
#include <vector>

#include "base/rung.h"
#include "base/time.h"

namespace relievo {

/// Goes down as soon as a window of frames was too much: by a rung, or to the lowest one where not a single
/// frame came. Goes up a rung after a longer time without trouble. A rung that turns out too much again soon
/// after it was climbed to has to be waited for twice as long the next time, so that a receiver at its limit
/// does not go to and fro. One thread. Pure: no clock of its own.
class QualityChoice {
 public:
  struct Options {
    double most_lost = 0.1;   // share of a window's frames; more: down
    double most_busy = 0.9;   // share of the time that frames took; more: down
    double calm_lost = 0.02;  // what still counts as no trouble; between the two nothing changes
    double calm_busy = 0.6;
    std::int64_t most_late_ns = 400'000'000;  // that each frame of a window waited on its way; more: down
    std::int64_t calm_late_ns = 150'000'000;
    std::int64_t window_ns = kNanosecondsPerSecond;  // what is judged at once,
    std::uint64_t window_frames = 8;                 // and at least so many frames
    std::int64_t calm_ns = 5 * kNanosecondsPerSecond;
    std::int64_t most_calm_ns = 80 * kNanosecondsPerSecond;
  };
  /// What happened since the last time.
  struct Seen {
    std::uint64_t arrived = 0;
    std::uint64_t lost = 0;    // sent to here, and not arrived or not taken
    std::int64_t busy_ns = 0;  // that frames took to decode and to use; 0 where it is not known
    std::int64_t late_ns = 0;  // that those that arrived waited on their way at least; likewise
  };

  QualityChoice() : QualityChoice(Options{}) {}
  explicit QualityChoice(const Options& options) : options_(options), wait_ns_(options.calm_ns) {}

  /// The rungs there are to choose from; full is always one. From a rung that is gone it goes to the next
  /// better one.
  void offer(const std::vector<Rung>& rungs);

  /// `now_ns`: monotonic. To be called about as often as frames come.
  Rung add(std::int64_t now_ns, const Seen& seen);
  Rung now() const { return now_; }

 private:
  void judge(std::int64_t now_ns);
  void move(Rung to);
  Rung below() const;
  Rung above() const;

  Options options_;
  std::vector<Rung> rungs_{Rung::kFull};  // best first
  Rung now_ = Rung::kFull;
  Seen window_;  // late_ns: of the frame that waited least, since a queue that stays lets none pass it
  std::int64_t window_from_ns_ = -1;  // below 0: it begins with the next call
  std::int64_t calm_from_ns_ = -1;    // below 0: there is trouble, or it is not known
  std::int64_t climbed_ns_ = -1;      // to this rung; below 0: it was not climbed to
  std::int64_t wait_ns_;              // without trouble before the next climb
};

}  // namespace relievo
