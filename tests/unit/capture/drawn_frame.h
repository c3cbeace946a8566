// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/image.h"
#include "base/rig.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Both exposures of a frame, of value(row, x, channel, complement) in each sample. The top field is first.
template <typename Value>
CapturedFrame drawn_frame(Scan scan, int width, int rows, const Value& value) {
  CapturedFrame out{.scan = scan};
  out.picture = Image8(width, rows, 3);
  if (scan == Scan::kProgressive) out.complement = Image8(width, rows, 3);
  for (int y = 0; y < rows; ++y) {
    for (int i = 0; i < 3 * width; ++i) {
      const bool odd = scan == Scan::kInterlaced && y % 2 == 1;
      out.picture.row(y)[i] = value(y, i / 3, i % 3, odd);
      if (scan == Scan::kProgressive) out.complement.row(y)[i] = value(y, i / 3, i % 3, true);
    }
  }
  return out;
}

}  // namespace relievo
