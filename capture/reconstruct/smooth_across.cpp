// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/smooth_across.h"

#include "capture/reconstruct/smooth_columns.h"

namespace relievo {

void smooth_across(WorkerPool& pool, DecodedGrid& grid) {
  const auto smooth = smoothers().back().across;
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      const DecodedRow row = grid.decoded(line);
      smooth(row.column_px, row.sigma_px, grid.boundaries());
    }
  });
}

}  // namespace relievo
