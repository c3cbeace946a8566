// SPDX-License-Identifier: Apache-2.0
#include "server/pace.h"

#include <algorithm>

#include "base/time.h"

namespace relievo {
namespace {

struct Step {
  Pace pace;
  // Times that the pace above takes as long. Measured from 640x480 to 1920x1080: 2.3 to 3.7 and 1.7 to 2,
  // since a part of each frame's time is the same for all of them.
  double dearer_above;
};
constexpr std::array<Step, 4> kSteps{{{{Decoder::kOrdered, 1}, 1},
                                      {{Decoder::kQuick, 1}, 3},
                                      {{Decoder::kQuick, 2}, 1.8},
                                      {{Decoder::kQuick, 4}, 1.8}}};
constexpr int kLeastLines = 100;  // that are left

constexpr double kDroppedShare = 0.05;  // of frames that may be dropped
constexpr double kBurst_s = 0.15;       // of frames, beyond that: a moment's trouble
constexpr double kFits = 0.85;          // of the period: more leaves no time to catch up
constexpr std::size_t kUnsettled = 2;   // frames of a pace that take longer: memory is allocated
constexpr double kFirstFrame = 3.5;     // times that they take as long, at most
constexpr std::size_t kFewest = 3;      // frames after them that tell what a frame takes
constexpr std::int64_t kCalm_ns = kNanosecondsPerSecond;       // before a climb
constexpr std::int64_t kHeld_ns = 30 * kNanosecondsPerSecond;  // at least, by a climb that was not in vain
constexpr std::int64_t kPause_ns = kNanosecondsPerSecond, kMostPause_ns = 300 * kNanosecondsPerSecond;
constexpr int kLonger = 4;  // times the pause, after a climb in vain

}  // namespace

std::string to_string(const Pace& pace) {
  const char* const lines[] = {"", ", every second line", ", every fourth line"};
  return std::string(decoder_name(pace.decoder)) + lines[pace.line_stride / 2];
}

void DropWatch::add(std::uint64_t dropped) {
  const auto of = static_cast<double>(dropped);
  beyond_ = std::max(0.0, beyond_ + of - kDroppedShare * (1 + of));
}

PaceControl::PaceControl(int lines, double frame_rate)
    : period_ms_(1e3 / frame_rate), drops_(kBurst_s * frame_rate) {
  static_assert(kSteps.size() == kPaces);
  while (paces_ < kPaces && lines / kSteps[paces_].pace.line_stride >= kLeastLines) ++paces_;
}

void PaceControl::add(std::int64_t now_ns, double ms, std::uint64_t dropped) {
  ++frames_;
  if (frames_ <= kUnsettled) {  // what is too long even for these is certain
    if (dropped > 0 && ms > kFirstFrame * period_ms_) down(now_ns, ms / kFirstFrame);
    begin_calm(now_ns);
    return;
  }
  recent_ms_[frames_ % kRecent] = ms;
  drops_.add(dropped);
  if (dropped > 0) {
    dropped_at_ = frames_;
    begin_calm(now_ns);
  } else {
    calm_ms_ += ms;
    ++calm_frames_;
  }
  const bool behind = dropped_at_ > 0 && frames_ - dropped_at_ < kRecent;
  const bool known = frames_ >= kUnsettled + kFewest;
  if (drops_.too_many() || (behind && known && typical_ms() > period_ms_)) return down(now_ns, typical_ms());
  up_if_it_fits(now_ns);
}

/// The mean of the last frames but for the one that took longest.
double PaceControl::typical_ms() const {
  const std::size_t count = std::min(kRecent, frames_ - kUnsettled);
  double sum = 0, most = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double ms = recent_ms_[(frames_ - i) % kRecent];
    sum += ms;
    most = std::max(most, ms);
  }
  return count > 1 ? (sum - most) / static_cast<double>(count - 1) : sum;
}

/// As far as has to be with frames that take `ms`.
void PaceControl::down(std::int64_t now_ns, double ms) {
  std::size_t to = pace_;
  for (double at = ms; to + 1 < paces_ && (to == pace_ || at > kFits * period_ms_);)
    at /= kSteps[++to].dearer_above;
  Failed& failed = failed_[pace_];
  const bool in_vain = climbed_ns_ >= 0 && now_ns - climbed_ns_ < std::max(kHeld_ns, failed.pause_ns);
  const std::int64_t pause_ns =
      in_vain ? std::min(kLonger * std::max(failed.pause_ns, kPause_ns), kMostPause_ns) : kPause_ns;
  if (to != pace_)
    failed = {.ms = std::max(ms, period_ms_), .pause_ns = pause_ns, .until_ns = now_ns + pause_ns};
  climbed_ns_ = -1;
  change_to(to);
}

void PaceControl::up_if_it_fits(std::int64_t now_ns) {
  if (now_ns - calm_from_ns_ < kCalm_ns || calm_frames_ < kRecent) return;
  const double ms = calm_ms_ / static_cast<double>(calm_frames_);
  begin_calm(now_ns);
  if (pace_ == 0) return;
  Failed& above = failed_[pace_ - 1];
  if (above.below_ms <= 0) above.below_ms = ms;
  if (ms * kSteps[pace_].dearer_above > kFits * period_ms_) return;
  if (now_ns < above.until_ns && above.ms * ms / above.below_ms > kFits * period_ms_) return;
  climbed_ns_ = now_ns;
  change_to(pace_ - 1);
}

void PaceControl::change_to(std::size_t pace) {
  pace_ = pace;
  frames_ = 0;
  dropped_at_ = 0;
  drops_.forget();  // and what was calm: the first frame begins that anew
}

void PaceControl::begin_calm(std::int64_t now_ns) {
  calm_from_ns_ = now_ns;
  calm_ms_ = 0;
  calm_frames_ = 0;
}

Pace PaceControl::now() const {
  return kSteps[pace_].pace;
}

}  // namespace relievo
