// SPDX-License-Identifier: Apache-2.0
#include "capture/evaluate/frame_places.h"

#include <algorithm>
#include <cmath>

namespace relievo {

std::vector<double> likely_periods_ns(std::span<const TakeStamp> stamps, double frame_rate) {
  constexpr double kGap = 10;  // frames, of which a step says little
  std::vector<double> steps;
  double time = 0, frames = 0;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const double step = static_cast<double>(stamps[i].time_ns - stamps[i - 1].time_ns);
    steps.push_back(step);
    const double passed = std::round(step * frame_rate / 1e9);
    if (passed < 1 || passed > kGap) continue;
    time += step;
    frames += passed;
  }
  if (steps.empty()) return {1e9 / frame_rate};
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double usual = *middle;
  if (frames == 0) return {usual};
  const double period = time / frames;
  if (std::abs(usual / period - 1) < 0.1) return {period};
  return {period, usual};
}

std::uint64_t FramePlaces::next(std::int64_t time_ns) {
  constexpr double kKept = 0.8;  // of what a stamp is off by, that the next one is off by less for it
  if (before_ns_) {
    const double passed = static_cast<double>(time_ns - *before_ns_) / period_ns_ + ahead_;
    const double frames = std::max(0., std::round(passed));
    ahead_ = kKept * (passed - frames);
    place_ += static_cast<std::uint64_t>(frames);
  }
  before_ns_ = time_ns;
  return place_;
}

}  // namespace relievo
