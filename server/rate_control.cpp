// SPDX-License-Identifier: Apache-2.0
#include "server/rate_control.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace relievo {
namespace {

// Measured by `relievo-bench rate --source sim:walk` (h264, metric). Other scenes and codecs differ, which
// the feedback takes up.
constexpr std::array kLevels{
    RateLevel{90, 6, true, true, 1.000, 1.000, 41.2},   RateLevel{85, 6, true, true, 0.886, 0.920, 41.15},
    RateLevel{80, 6, true, true, 0.791, 0.890, 40.9},   RateLevel{75, 5, true, true, 0.676, 0.860, 40.7},
    RateLevel{70, 5, false, true, 0.446, 0.840, 40.2},  RateLevel{64, 4, false, true, 0.357, 0.820, 39.7},
    RateLevel{57, 4, false, true, 0.293, 0.770, 39.0},  RateLevel{50, 4, false, false, 0.223, 0.765, 38.2},
    RateLevel{42, 3, false, false, 0.167, 0.758, 37.4}, RateLevel{34, 3, false, false, 0.140, 0.742, 35.9},
    RateLevel{25, 2, false, false, 0.111, 0.640, 34.9}, RateLevel{15, 2, false, false, 0.098, 0.620, 33.5}};
constexpr double kCoarsest = static_cast<double>(kLevels.size() - 1);

constexpr double kFirstPlace = 4;  // until the first frames have been seen
constexpr double kRising = 0.4;  // share of a new size that is larger than expected: in 0.2 s it is believed
constexpr double kFalling = 0.15;  // and of a smaller one
constexpr double kMostRise = 3;    // times the expected size: a single frame is not believed further
constexpr double kAim = 0.98;      // of the rate
constexpr double kPaidEach =
    8;  // a frame pays this part of what is owed, so that 2 % are left after kPayback
constexpr double kLeastShare = 0.3;  // of its share is left to a frame while others are paid back
constexpr double kMostShare = 1.15;  // and no more, where frames before were small
constexpr double kMostOwed = 10;     // shares: what no level can keep is not held against what comes after
constexpr double kMostSpared = 5;
constexpr double kCoarser = 0.6;  // part of the way to a coarser place that a frame goes
constexpr double kFiner = 0.12;
constexpr double kFormReach = 1.5;  // levels: step, sigmas and lines stay until it is so far away
constexpr std::size_t kLeastTimes = 16;
constexpr double kReserve = 0.9;  // of the deadline
constexpr double kSeen = 0.5;     // part of a new PSNR that is believed

using Field = double RateLevel::*;

/// Of a place between levels. Geometric, since levels are ratios.
double at(Field field, double place) {
  const double below = std::floor(std::clamp(place, 0.0, kCoarsest));
  const auto i = static_cast<std::size_t>(below);
  if (i + 1 >= kLevels.size()) return kLevels.back().*field;
  const double part = std::clamp(place, 0.0, kCoarsest) - below;
  return std::pow(kLevels[i].*field, 1 - part) * std::pow(kLevels[i + 1].*field, part);
}

/// The finest place with at most so much.
double place_of(Field field, double value) {
  if (!(value < kLevels.front().*field)) return 0;
  for (std::size_t i = 1; i < kLevels.size(); ++i) {
    const double fine = kLevels[i - 1].*field;
    const double coarse = kLevels[i].*field;
    if (value >= coarse)
      return static_cast<double>(i - 1) +
             (fine > coarse ? std::log(fine / value) / std::log(fine / coarse) : 0);
  }
  return kCoarsest;
}

int quality_at(double place) {
  const auto i = static_cast<std::size_t>(std::clamp(place, 0.0, kCoarsest));
  if (i + 1 >= kLevels.size()) return kLevels.back().texture_quality;
  const double part = place - static_cast<double>(i);
  return static_cast<int>(std::lround(kLevels[i].texture_quality +
                                      part * (kLevels[i + 1].texture_quality - kLevels[i].texture_quality)));
}

/// The coarsest place at which nothing is coarser than `asked`.
double finest_place(const EncodeOptions& asked) {
  for (std::size_t i = 1; i < kLevels.size(); ++i) {
    const RateLevel& from = kLevels[i - 1];
    const RateLevel& to = kLevels[i];
    const bool coarser = to.step_bits < asked.step_bits || (asked.quality && !to.sigmas) ||
                         (!asked.halve_lines && !to.every_line);
    if (!coarser && to.texture_quality >= asked.texture_quality) continue;
    const auto place = static_cast<double>(i - 1);
    if (from.texture_quality <= asked.texture_quality) return place;
    return place + std::min(1.0, static_cast<double>(from.texture_quality - asked.texture_quality) /
                                     (from.texture_quality - to.texture_quality));
  }
  return kCoarsest;
}

void smooth(std::optional<double>& average, double value) {
  if (!average) average = value;
  value = std::min(value, kMostRise * *average);
  *average += (value > *average ? kRising : kFalling) * (value - *average);
}

}  // namespace

std::span<const RateLevel> rate_levels() {
  return kLevels;
}

RateControl::RateControl(const RateTargets& targets, double frames_per_s, const EncodeOptions& asked)
    : targets_(targets),
      asked_(asked),
      share_(kAim * targets.bit_rate / 8 / frames_per_s),
      finest_(finest_place(asked)),
      for_rate_(targets.bit_rate > 0 ? std::max(kFirstPlace, finest_) : finest_),
      for_deadline_(targets.deadline_ms > 0 ? std::max(kFirstPlace, finest_) : finest_),
      for_quality_(finest_),
      place_(std::max(for_rate_, for_deadline_)),
      form_(static_cast<int>(std::lround(place_))) {}

int RateControl::level() const {
  return place_ <= finest_ ? 0 : std::max(1, static_cast<int>(std::lround(place_)));
}

void RateControl::apply(EncodeOptions& options) const {
  if (place_ <= finest_) return;
  const RateLevel& form = kLevels[static_cast<std::size_t>(form_)];
  options.texture_quality = std::min(options.texture_quality, quality_at(place_));
  options.step_bits = std::min(options.step_bits, form.step_bits);
  options.quality = options.quality && form.sigmas;
  options.halve_lines = options.halve_lines || !form.every_line;
}

/// What a frame takes in the mean, at level 0.
double RateControl::key_share(int key_interval) const {
  const double key = key_.value_or(delta_.value_or(0));
  const double delta = delta_.value_or(key);
  return (key + (key_interval - 1) * delta) / key_interval;
}

void RateControl::add(std::size_t bytes, bool is_key, int key_interval) {
  if (targets_.bit_rate > 0) {
    const double size = static_cast<double>(bytes) / at(&RateLevel::size, place_);
    smooth(is_key ? key_ : delta_, size);
    since_key_ = is_key ? 1 : since_key_ + 1;
    debt_ += static_cast<double>(bytes) - share_;
    // A key frame alone tells little of the others.
    if (delta_ || key_interval == 1) for_rate_ = place_for_rate(key_interval);
  }
  move();
}

double RateControl::place_for_rate(int key_interval) {
  const double now = at(&RateLevel::size, place_);
  const double mean = key_share(key_interval);
  // What is owed between key frames as a matter of course.
  double usual = 0;
  if (key_interval > 1 && key_ && delta_)
    usual = now * (*key_ - mean + std::min(since_key_ - 1, key_interval - 1) * (*delta_ - mean));
  const double owed = std::clamp(debt_ - usual, -kMostSpared * share_, kMostOwed * share_);
  debt_ = usual + owed;
  const double left = std::clamp(share_ - owed / kPaidEach, kLeastShare * share_, kMostShare * share_);
  return mean > 0 ? place_of(&RateLevel::size, left / mean) : finest_;
}

void RateControl::took(double ms, double place) {
  if (targets_.deadline_ms <= 0) return;
  times_[times_seen_++ % times_.size()] = static_cast<float>(ms / at(&RateLevel::time, place));
  if (times_seen_ >= kLeastTimes) for_deadline_ = place_for_deadline();
}

double RateControl::place_for_deadline() const {
  const std::size_t count = std::min(times_seen_, times_.size());
  auto sorted = times_;
  // One in a hundred may be above.
  const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>(count / 100);
  std::nth_element(sorted.begin(), nth, sorted.begin() + static_cast<std::ptrdiff_t>(count),
                   std::greater<>());
  const double slow = static_cast<double>(*nth);
  return slow > 0 ? place_of(&RateLevel::time, kReserve * targets_.deadline_ms / slow) : finest_;
}

void RateControl::looked(double texture_db, double place) {
  if (targets_.texture_db <= 0) return;
  // Other scenes are better or worse than the table's by about the same at all levels.
  const double better = texture_db - at(&RateLevel::texture_db, place);
  const double wanted = std::max(finest_, place_of(&RateLevel::texture_db, targets_.texture_db - better));
  for_quality_ += kSeen * (wanted - for_quality_);
}

void RateControl::move() {
  const double wanted = std::clamp(std::max({for_rate_, for_deadline_, for_quality_}), finest_, kCoarsest);
  place_ += (wanted > place_ ? kCoarser : kFiner) * (wanted - place_);
  if (std::abs(place_ - wanted) < 0.01) place_ = wanted;
  if (std::abs(place_ - form_) > kFormReach) form_ = static_cast<int>(std::lround(place_));
}

}  // namespace relievo
