// SPDX-License-Identifier: Apache-2.0
#include "capture/projector/refresh_count.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace relievo {
namespace {

constexpr std::size_t kLeastMeasured = 16;  // intervals, before they are believed
constexpr double kTooFast = 0.7;            // of the told interval: nothing is being waited for

}  // namespace

RefreshCount::RefreshCount(double refresh_hz, int each) : told_hz_(refresh_hz), each_(each) {}

double RefreshCount::median_interval_ns() const {
  const std::size_t n = std::min(measured_, intervals_ns_.size());
  std::vector<std::int64_t> sorted(intervals_ns_.begin(),
                                   intervals_ns_.begin() + static_cast<std::ptrdiff_t>(n));
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return static_cast<double>(*middle);
}

double RefreshCount::refresh_hz() const {
  if (measured_ < kLeastMeasured || !synchronised_) return told_hz_;
  const auto n = static_cast<std::ptrdiff_t>(std::min(measured_, intervals_ns_.size()));
  const auto ns = std::accumulate(intervals_ns_.begin(), intervals_ns_.begin() + n, std::int64_t{0});
  const auto passed = std::accumulate(passed_.begin(), passed_.begin() + n, std::uint64_t{0});
  return static_cast<double>(passed) * 1e9 / static_cast<double>(ns);
}

std::uint64_t RefreshCount::flip(const Flip& flip) {
  ++pictures_;
  if (!last_) {
    last_ = flip;
    return 0;
  }
  const std::int64_t interval_ns = flip.time_ns - last_->time_ns;
  const std::size_t place = measured_++ % intervals_ns_.size();
  intervals_ns_[place] = interval_ns;
  passed_[place] = static_cast<std::uint64_t>(each_);
  // Single pictures may come late and the next one early; only if all do nothing waits. For good: what is
  // paced by the clock from then on comes in time.
  if (told_hz_ > 0 && measured_ >= kLeastMeasured &&
      median_interval_ns() <= kTooFast * each_ * 1e9 / told_hz_)
    synchronised_ = false;
  const auto each = static_cast<std::uint64_t>(each_);
  std::uint64_t passed = each;
  if (flip.refresh && last_->refresh && *flip.refresh > *last_->refresh) {
    passed = std::max(each, *flip.refresh - *last_->refresh);
  } else if (refresh_hz() > 0) {
    const double by_time = std::round(static_cast<double>(interval_ns) * 1e-9 * refresh_hz());
    passed = std::max(each, static_cast<std::uint64_t>(std::max(0.0, by_time)));
  }
  passed_[place] = passed;
  refreshes_ += passed;
  missed_ += passed - each;
  last_ = flip;
  return refreshes_;
}

}  // namespace relievo
