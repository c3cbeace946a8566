// SPDX-License-Identifier: Apache-2.0
#include "server/rate_control.h"

#include <algorithm>
#include <array>

namespace relievo {
namespace {

// Measured by scripts/rate_table: sim:walk with h264. Other scenes and codecs differ, which the feedback
// takes up.
constexpr std::array kLevels{RateLevel{90, 6, 1.00}, RateLevel{85, 6, 0.66}, RateLevel{80, 5, 0.49},
                             RateLevel{75, 5, 0.42}, RateLevel{70, 4, 0.35}, RateLevel{64, 4, 0.32},
                             RateLevel{57, 3, 0.27}, RateLevel{50, 3, 0.25}, RateLevel{42, 2, 0.21},
                             RateLevel{34, 2, 0.20}, RateLevel{25, 1, 0.19}, RateLevel{15, 0, 0.17}};

constexpr int kFirstLevel = 4;    // until the first frames have been seen
constexpr double kRising = 0.4;   // share of a new size that is larger than expected: in 0.2 s it is believed
constexpr double kFalling = 0.1;  // and of a smaller one
constexpr double kReserve = 0.92;  // what a finer level has to fit in, so that levels do not alternate
constexpr int kFramesBeforeFiner = 8;

void smooth(std::optional<double>& average, double value) {
  if (!average) average = value;
  *average += (value > *average ? kRising : kFalling) * (value - *average);
}

}  // namespace

std::span<const RateLevel> rate_levels() {
  return kLevels;
}

RateControl::RateControl(double bits_per_s, double frames_per_s)
    : target_bytes_(bits_per_s / 8 / frames_per_s), level_(kFirstLevel) {}

void RateControl::apply(EncodeOptions& options) const {
  const RateLevel& level = kLevels[static_cast<std::size_t>(level_)];
  options.texture_quality = std::min(options.texture_quality, level.texture_quality);
  options.step_bits = std::min(options.step_bits, level.step_bits);
}

double RateControl::expected(double level_size, int key_interval) const {
  const double key = key_.value_or(delta_.value_or(0));
  const double delta = delta_.value_or(key);
  return level_size * (key + (key_interval - 1) * delta) / key_interval;
}

void RateControl::add(std::size_t bytes, bool is_key, int key_interval) {
  const double size = static_cast<double>(bytes) / kLevels[static_cast<std::size_t>(level_)].size;
  smooth(is_key ? key_ : delta_, size);
  if (is_key && !delta_ && key_interval > 1) return;  // a key frame alone tells little of the others
  const auto fits = [&](int level, double share) {
    return expected(kLevels[static_cast<std::size_t>(level)].size, key_interval) <= share * target_bytes_;
  };
  const int coarsest = static_cast<int>(kLevels.size()) - 1;
  if (!fits(level_, 1)) {
    while (level_ < coarsest && !fits(level_, 1)) ++level_;
    patience_ = 0;
  } else if (level_ > 0 && fits(level_ - 1, kReserve)) {
    if (++patience_ < kFramesBeforeFiner) return;
    --level_;
    patience_ = 0;
  } else {
    patience_ = 0;
  }
}

}  // namespace relievo
