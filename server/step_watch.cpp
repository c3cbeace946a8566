// SPDX-License-Identifier: Apache-2.0
#include "server/step_watch.h"

#include <algorithm>

#include "capture/pattern/schedule.h"

namespace relievo {
namespace {

constexpr std::size_t kLately = 150;    // frames: seconds
constexpr std::uint64_t kMany = 10;     // % of them: worth a word
constexpr std::uint64_t kFew = 2;       // % of them: all is well again
constexpr std::uint64_t kLeast = 15;    // frames before anything is said
constexpr std::uint64_t kRenewed = 30;  // frames, after which what is said is brought up to date
constexpr std::uint64_t kCyclesWithoutWhite = 4;

std::string advice_of_exchange(const Rig& rig) {
  const std::string found = "frames decode far better with the exposures of each the other way round: ";
  if (rig.scan == Scan::kProgressive)
    return found +
           "the first picture of a frame is to be the one under the slide, the second the one under its "
           "complement";
  const std::string is(to_string(other(rig.field_order)));
  return found + "is the " + is + " field exposed first? Then rig.yaml must have field_order: " + is +
         "; of a camera also --field-order " + is;
}

}  // namespace

StepWatch::StepWatch(const Pattern& pattern, const Rig& rig)
    : frame_rate_(rig.frame_rate),
      exchange_advice_(advice_of_exchange(rig)),
      white_every_(pattern.scheme == Scheme::kWhiteFrame ? static_cast<std::uint64_t>(cycle_frames(pattern))
                                                         : 0),
      lately_(kLately) {}

void StepWatch::add(std::int64_t time_ns, const ReconstructReport& report) {
  if (report.exchanged)
    ++exchanged_;
  else if (report.matched > 0)
    exchanged_ = 0;
  if (white_every_ > 0) return look_for_white(report.white);
  add(time_ns, report.step);
}

void StepWatch::look_for_white(bool white) {
  without_white_ = white ? 0 : without_white_ + 1;
  if (white) message_.clear();
  if (without_white_ == kCyclesWithoutWhite * white_every_)
    message_ =
        "no frame is white, as one of " + std::to_string(white_every_) +
        " must be under white-frame: both exposures of each must lie within one slide's time, in step with "
        "the projector (genlock); or does it show another scheme?";
}

void StepWatch::add(std::int64_t time_ns, const StepReport& step) {
  if (step.phase) {
    status_.phase = *step.phase;
    if (step.mixed) mixed_phase_ = step.phase;
    drift_.add(time_ns, *step.phase);
  }
  std::uint8_t& slot = lately_[frames_++ % kLately];
  mixed_lately_ -= slot;
  slot = step.mixed ? 1 : 0;
  mixed_lately_ += slot;
  status_.mixed += slot;
  status_.regrouped += step.regrouped ? 1 : 0;
  const std::uint64_t seen = std::min<std::uint64_t>(frames_, kLately);
  const std::uint64_t share = 100 * mixed_lately_ / seen;
  if (frames_ % kLeast == 0) status_.drift_fields_s = drift_.per_second();
  if (seen >= kLeast && share >= kMany && (message_.empty() || frames_ % kRenewed == 0))
    message_ = std::to_string(share) + " % of frames are dropped for mixed exposures: " + advice();
  if (share < kFew) message_.clear();
}

std::string StepWatch::advice() const {
  return mixed_phase_ ? step_advice(*mixed_phase_, drift_.per_second(), frame_rate_) : "";
}

}  // namespace relievo
