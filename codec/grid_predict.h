// SPDX-License-Identifier: Apache-2.0
// What a line of the stripe grid is expected to be, from the lines above it and from the key frame. As
// capture/reconstruct/rows.h: one portable implementation and others with the same results.
#pragma once

#include <cstdint>
#include <vector>

namespace relievo {

/// Weights are of 256. A difference beyond `limit` steps, or with a place that is absent, counts as none.
struct GridModel {
  static constexpr int kMostWeight = 1024;
  static constexpr int kMostLimit = 4096;

  std::int16_t slope1 = 205, slope2 = 51,
               slope3 = 0;               // of the differences of the three lines above, nearest first
  std::int16_t key = 0, key_change = 0;  // of key less expected, and of the line above less its key
  std::uint16_t limit = 32;              // steps
  std::int32_t spacing = 0;              // from boundary to boundary, steps
};

/// Places of one boundary range on the lines above, nearest first, in the key frame on this line and the one
/// above; StripeGrid::kAbsent where there is no vertex. Key rows are null in key frames.
struct GridRows {
  const std::int32_t *up1, *up2, *up3, *up4;
  const std::int32_t *key, *key_up;
};

struct GridKernels {
  const char* name;

  /// `count` rounded up to 8 places. Of no meaning where up1 is absent.
  void (*predict)(const GridRows& rows, const GridModel& model, int count, std::int32_t* expected);

  /// Number of the residuals' table by the sizes of those around on the lines above (see grid_coder.cpp):
  /// `sizes` may be read one place before and behind. `count` rounded up to 8 places.
  void (*contexts)(const std::uint8_t* sizes, int count, std::uint8_t* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<GridKernels>& all_grid_kernels();

/// The best that runs on this machine.
const GridKernels& grid_kernels();

}  // namespace relievo
