// SPDX-License-Identifier: Apache-2.0
#include "base/quality_choice.h"

#include <algorithm>

namespace relievo {

void QualityChoice::offer(const std::vector<Rung>& rungs) {
  rungs_ = rungs;
  rungs_.push_back(Rung::kFull);
  std::sort(rungs_.begin(), rungs_.end());
  rungs_.erase(std::unique(rungs_.begin(), rungs_.end()), rungs_.end());
  if (std::find(rungs_.begin(), rungs_.end(), now_) == rungs_.end()) now_ = above();
}

Rung QualityChoice::below() const {
  const auto next = std::upper_bound(rungs_.begin(), rungs_.end(), now_);
  return next == rungs_.end() ? now_ : *next;
}

Rung QualityChoice::above() const {
  const auto here = std::lower_bound(rungs_.begin(), rungs_.end(), now_);
  return here == rungs_.begin() ? now_ : *(here - 1);
}

Rung QualityChoice::add(std::int64_t now_ns, const Seen& seen) {
  if (window_from_ns_ < 0) {
    window_from_ns_ = now_ns;
    return now_;  // since when these frames are is not known
  }
  if (seen.arrived > 0)
    window_.late_ns = window_.arrived == 0 ? seen.late_ns : std::min(window_.late_ns, seen.late_ns);
  window_.arrived += seen.arrived;
  window_.lost += seen.lost;
  window_.busy_ns += seen.busy_ns;
  if (now_ns - window_from_ns_ < options_.window_ns) return now_;
  if (window_.arrived + window_.lost == 0) {  // a stream that stands still tells nothing
    window_from_ns_ = now_ns;
    calm_from_ns_ = -1;
    return now_;
  }
  if (window_.arrived + window_.lost >= options_.window_frames) judge(now_ns);
  return now_;
}

void QualityChoice::judge(std::int64_t now_ns) {
  const double lost = static_cast<double>(window_.lost) / static_cast<double>(window_.arrived + window_.lost);
  const double busy = static_cast<double>(window_.busy_ns) /
                      static_cast<double>(std::max<std::int64_t>(1, now_ns - window_from_ns_));
  const std::int64_t late_ns = window_.late_ns;
  const Rung lower = window_.arrived == 0 ? rungs_.back() : below();
  const std::int64_t from_ns = window_from_ns_;
  window_ = {};
  window_from_ns_ = now_ns;
  if (lost > options_.most_lost || busy > options_.most_busy || late_ns > options_.most_late_ns) {
    calm_from_ns_ = -1;
    if (lower == now_) return;
    // Climbed in vain: the next time only after longer.
    const bool in_vain = climbed_ns_ >= 0 && now_ns - climbed_ns_ < wait_ns_;
    wait_ns_ = in_vain ? std::min(2 * wait_ns_, options_.most_calm_ns) : options_.calm_ns;
    move(lower);
    climbed_ns_ = -1;
    return;
  }
  if (lost > options_.calm_lost || busy > options_.calm_busy || late_ns > options_.calm_late_ns) {
    calm_from_ns_ = -1;
    return;
  }
  if (calm_from_ns_ < 0) calm_from_ns_ = from_ns;
  if (now_ns - calm_from_ns_ < wait_ns_ || above() == now_) return;
  move(above());
  climbed_ns_ = now_ns;
}

/// What is measured during the change is of both rungs, and so of none.
void QualityChoice::move(Rung to) {
  now_ = to;
  window_from_ns_ = -1;
  calm_from_ns_ = -1;
}

}  // namespace relievo
