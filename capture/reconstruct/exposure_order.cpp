// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/exposure_order.h"

#include <algorithm>

namespace relievo {
namespace {

constexpr std::size_t kLeast = 100;  // boundaries: fewer tell nothing
// Of simulated scenes 0.7 to 2 % of what is decoded is given up, and 3 to 25 % where exposures are exchanged:
constexpr double kDoubtful = 0.02;
// five times as much and more.
constexpr std::size_t kClear = 2;
constexpr std::size_t kLeastApart = 20;  // boundaries
constexpr int kSeldom = 240;             // frames

std::size_t given_up(const ReconstructReport& report) {
  return report.filters.unsupported + report.filters.rejected;
}

}  // namespace

ExposureOrder::ExposureOrder(const Rig& rig, const Pattern& pattern, int line_stride)
    : trial_(rig, pattern, line_stride) {}

bool ExposureOrder::exchanged(const CapturedFrame& pair, const ReconstructReport& report, WorkerPool& pool) {
  wait_ = std::max(wait_ - 1, 0);
  if (known_ && static_cast<double>(given_up(report)) < kDoubtful * static_cast<double>(report.matched)) {
    pause_ = kSoon;
    wait_ = std::min(wait_, pause_);
    return false;
  }
  if (report.matched < kLeast || wait_ > 0) return false;
  const CapturedFrame turned = exchanged_pair(pair);
  const std::size_t as_it_is = given_up(trial_.decode({&pair}, pool));
  const std::size_t other = given_up(trial_.decode({&turned}, pool));
  const auto clear = [](std::size_t less, std::size_t more) { return kClear * less + kLeastApart < more; };
  const bool exchanged = clear(other, as_it_is);
  const bool kept = clear(as_it_is, other);
  known_ = exchanged || kept;
  // What goes on being doubtful the right way round is asked about less and less.
  pause_ = kept ? std::min(2 * pause_, kSeldom) : kSoon;
  wait_ = pause_;
  return exchanged;
}

}  // namespace relievo
