// SPDX-License-Identifier: Apache-2.0
// Where one surface goes on from one grid place to the next, by the columns of a whole frame (column_grid.h).
// As rows.h: one portable implementation and others with the same results.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/surface_cells.h"

namespace relievo {

/// [line][boundary], kLink and kSureLink; nothing outside the grid, where lines -1 and `lines` can be asked
/// for.
class GridLinks {
 public:
  /// As large as `grid`, of undefined links but outside.
  void fit(const DecodedGrid& grid);
  /// Links to the next boundary on a line, and to the same boundary on the next line. As long as its rows.
  std::uint8_t* across(int line) { return across_.data() + row(line); }
  const std::uint8_t* across(int line) const { return across_.data() + row(line); }
  std::uint8_t* along(int line) { return along_.data() + row(line); }
  const std::uint8_t* along(int line) const { return along_.data() + row(line); }

 private:
  std::size_t row(int line) const { return static_cast<std::size_t>(line + 1) * stride_; }

  std::size_t stride_ = 0;
  int lines_ = 0;
  std::vector<std::uint8_t> across_, along_;
};

/// kSureLink are those along of columns with standard deviations below this, both.
inline constexpr float kSure_px = 0.12F;

void find_links(const DecodedGrid& grid, const ColumnScale& scale, WorkerPool& pool, GridLinks& out);

/// The columns of a line and those around it, and the standard deviations of its and the next one's.
struct ColumnRows {
  const float *above, *here, *below, *further;
  const float *sigma_here, *sigma_below;
};

struct LinkKernels {
  const char* name;

  /// Links of `count` boundaries, and none for up to 7 more. Rows are as those of a DecodedGrid.
  void (*find)(const ColumnRows& rows, const ColumnScale& scale, int count, std::uint8_t* across,
               std::uint8_t* along);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<LinkKernels>& all_link_kernels();

/// The best that runs on this machine.
const LinkKernels& link_kernels();

}  // namespace relievo
