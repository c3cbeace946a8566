// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/join_exposures.h"

#include <algorithm>

#include "capture/pattern/schedule.h"
#include "capture/reconstruct/texture.h"

namespace relievo {

void join_exposures(const Image8& before, const CapturedFrame& now, CapturedFrame& out) {
  out.scan = now.scan;
  copy_picture(before, out.picture);
  if (now.scan == Scan::kProgressive) {
    copy_picture(now.picture, out.complement);
    return;
  }
  out.field_order = other(now.field_order);
  for (int y = first_row(now.field_order, 0); y < out.picture.height(); y += 2)
    std::copy_n(now.picture.row(y), out.picture.stride(), out.picture.row(y));
}

}  // namespace relievo
