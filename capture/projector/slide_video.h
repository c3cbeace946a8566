// SPDX-License-Identifier: Apache-2.0
// Slides as lossless video for a player, as the paper's system plays its slides from tape (4.1): FFV1 in
// Matroska, RGB, every pixel and frame exact; interlaced frames are flagged with their field order.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

struct SlideVideoOptions {
  int width = 0, height = 0;  // the projector's pixels
  bool interlaced = false;    // a frame holds both fields; otherwise a frame a field, at twice the rate
  FieldOrder field_order = FieldOrder::kTop;  // of interlaced frames
  double frame_rate = 29.97;  // field pairs a second; within 1e-4 of N * 1000 / 1001 it is that exactly
  double duration_s = 10;     // rounded up to whole cycles of the schedule, so that a player may loop it
  std::function<bool()> stopped = {};  // asked now and then; true ends with an error and no file
};

struct SlideVideo {
  std::uint64_t pictures = 0;                    // frames of the video
  int rate_numerator = 0, rate_denominator = 1;  // pictures a second
};

/// Writes what the pattern's scheme shows, in its order from the first slide on, into `file`, which is
/// replaced when complete. Fails where the file cannot be written, or this build is without libavformat.
Result<SlideVideo> write_slide_video(const std::filesystem::path& file, const Pattern& pattern,
                                     const SlideVideoOptions& options);

}  // namespace relievo
