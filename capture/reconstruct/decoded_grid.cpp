// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/decoded_grid.h"

#include <algorithm>

namespace relievo {

void DecodedGrid::reset(int boundaries, int lines) {
  boundaries_ = boundaries;
  lines_ = lines;
  stride_ = kLeft + (static_cast<std::size_t>(boundaries) + 7) / 8 * 8 + kRight;
  cells_.assign(static_cast<std::size_t>(lines + 2 * kMargin) * kPlanes * stride_, kNoColumn);
  interpolated_.clear();
}

void DecodedGrid::start_line(int line) {
  std::fill_n(column_px(line), boundaries_, kNoColumn);
}

void DecodedGrid::start_interpolated() {
  interpolated_.assign(static_cast<std::size_t>(lines_) * stride_, 0);
}

}  // namespace relievo
