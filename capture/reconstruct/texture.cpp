// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/texture.h"

#include <algorithm>

namespace relievo {

void add_fields(const CapturedFrame& frame, WorkerPool& pool, Image8& out) {
  const View8 picture = frame.picture.view();
  const int height = picture.height;
  const int samples = picture.width * 3;
  if (out.width() != picture.width || out.height() != height || out.channels() != 3)
    out = Image8(picture.width, height, 3);
  pool.for_ranges(height, [&](int begin, int end, int) {
    for (int y = begin; y < end; ++y) {
      const std::uint8_t* own = picture.row(y);
      std::uint8_t* to = out.row(y);
      if (frame.scan == Scan::kProgressive) {
        const std::uint8_t* other = frame.complement.row(y);
        for (int i = 0; i < samples; ++i) to[i] = static_cast<std::uint8_t>(std::min(255, own[i] + other[i]));
      } else {
        if (height == 1) {  // there is no other field
          std::copy_n(own, samples, to);
          continue;
        }
        // Rows above and below are of the other field; at the picture's edge the one there is serves for
        // both.
        const std::uint8_t* above = picture.row(y > 0 ? y - 1 : y + 1);
        const std::uint8_t* below = picture.row(y + 1 < height ? y + 1 : y - 1);
        for (int i = 0; i < samples; ++i) {
          to[i] = static_cast<std::uint8_t>(std::min(255, own[i] + (above[i] + below[i] + 1) / 2));
        }
      }
    }
  });
}

}  // namespace relievo
