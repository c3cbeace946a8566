// SPDX-License-Identifier: Apache-2.0
// What is projected in each field under a scheme (paper 5.1, 5.5): the one table that the simulator, the
// slide writer and the scorer go by. All functions are pure; any thread.
#pragma once

#include <cstdint>

#include "base/pattern.h"
#include "base/rig.h"

namespace relievo {

enum class Light { kSlide, kComplement, kWhite };

/// One field's projection.
struct Exposure {
  Light light;
  int slide;  // 0..slides-1; of a white field that of the other field in its frame, of a white frame 0

  bool operator==(const Exposure&) const = default;
};

/// Frames until everything repeats: the slides, and the white frame where there is one.
int cycle_frames(const Pattern& pattern);

/// What the field exposed first (`half` 0) or second (1) of frame `frame` shows, frames counted with the lost
/// ones.
Exposure shown(const Pattern& pattern, std::uint64_t frame, int half);

/// Surfaces and textures a second under the pattern's scheme: multiples of the rig's frame rate.
double geometry_rate(const Pattern& pattern, double frame_rate);
double texture_rate(const Pattern& pattern, double frame_rate);

/// Camera row of the first line of the field that is exposed first (`half` 0) or second (1).
inline int first_row(FieldOrder order, int half) {
  return order == FieldOrder::kTop ? half : 1 - half;
}

inline FieldOrder other(FieldOrder order) {
  return order == FieldOrder::kTop ? FieldOrder::kBottom : FieldOrder::kTop;
}

}  // namespace relievo
