// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/exposure_doubt.h"

#include <algorithm>

namespace relievo {
namespace {

constexpr std::size_t kLeast = 100;  // boundaries: fewer tell nothing
// Of what simulated scenes show nine tenths are decoded and kept, and less than half where exposures are
// exchanged, by every decoder. Scenes out of focus keep little either way.
constexpr double kDoubtful = 0.6;
constexpr double kFarBetter = 1.5;
constexpr int kSeldom = 240;  // frames

std::size_t kept(const ReconstructReport& report) {
  const std::size_t given_up = report.filters.unsupported + report.filters.rejected;
  return report.matched - std::min(report.matched, given_up);
}

}  // namespace

ExposureDoubt::ExposureDoubt(const Rig& rig, const Pattern& pattern, int line_stride)
    : trial_(rig, pattern, line_stride) {}

bool ExposureDoubt::better_exchanged(const CapturedFrame& pair, WorkerPool& pool) const {
  const CapturedFrame turned_before = exchanged_pair(before_), turned = exchanged_pair(pair);
  const std::size_t as_it_is = kept(trial_.decode({&before_, &pair}, pool));
  const std::size_t other = kept(trial_.decode({&turned_before, &turned}, pool));
  return static_cast<double>(other) > kFarBetter * static_cast<double>(as_it_is + kLeast);
}

bool ExposureDoubt::exchanged(const CapturedFrame& pair, const ReconstructReport& report, WorkerPool& pool) {
  if (report.boundaries < kLeast) return exchanged_;
  if (static_cast<double>(kept(report)) > kDoubtful * static_cast<double>(report.boundaries)) {
    exchanged_ = false;
    pause_ = wait_ = kSoon;
    before_ = {};
    return false;
  }
  if (exchanged_ || --wait_ > 0) {
    // Only the one before the next trial is needed.
    if (!exchanged_ && wait_ == 1) before_ = pair.clone();
    return exchanged_;
  }
  exchanged_ = better_exchanged(pair, pool);
  before_ = {};
  // What goes on being doubtful as it is is asked about less and less.
  pause_ = exchanged_ ? kSoon : std::min(2 * pause_, kSeldom);
  wait_ = pause_;
  return exchanged_;
}

}  // namespace relievo
