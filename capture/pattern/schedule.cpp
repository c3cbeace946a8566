// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/schedule.h"

namespace relievo {

int cycle_frames(const Pattern& pattern) {
  return pattern.slides + (pattern.scheme == Scheme::kWhiteFrame ? 1 : 0);
}

Exposure shown(const Pattern& pattern, std::uint64_t frame, int half) {
  const int place = static_cast<int>(frame % static_cast<std::uint64_t>(cycle_frames(pattern)));
  if (place == pattern.slides) return {Light::kWhite, 0};
  if (half == 0) return {Light::kSlide, place};
  return {pattern.scheme == Scheme::kWhiteField ? Light::kWhite : Light::kComplement, place};
}

double geometry_rate(const Pattern& pattern, double frame_rate) {
  switch (pattern.scheme) {
    case Scheme::kWhiteField:
      return 2 * frame_rate;
    case Scheme::kWhiteFrame:
      return frame_rate * pattern.slides / cycle_frames(pattern);
    default:
      return frame_rate;
  }
}

double texture_rate(const Pattern& pattern, double frame_rate) {
  return pattern.scheme == Scheme::kWhiteFrame ? frame_rate / cycle_frames(pattern) : frame_rate;
}

}  // namespace relievo
