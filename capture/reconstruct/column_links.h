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

namespace relievo {

/// Rows of bits (eight.h), as CellLinks asks for: the surface goes on to the next boundary on the line, or to
/// the same one on the next line; and where it does so between columns with standard deviations below
/// kSure_px.
struct LinkRow {
  std::uint8_t *across, *along, *sure_along;
};
inline constexpr float kSure_px = 0.12F;

/// A LinkRow for each line; nothing outside the grid, where lines -1 and `lines` can be asked for.
class GridLinks {
 public:
  /// As large as `grid`, of undefined links but outside.
  void fit(const DecodedGrid& grid);
  LinkRow row(int line) { return {of(line, 0), of(line, 1), of(line, 2)}; }
  const std::uint8_t* across(int line) const { return of(line, 0); }
  const std::uint8_t* along(int line) const { return of(line, 1); }
  const std::uint8_t* sure_along(int line) const { return of(line, 2); }

 private:
  std::size_t first_of(int line, std::size_t which) const {
    return (3 * static_cast<std::size_t>(line + 1) + which) * bytes_;
  }
  std::uint8_t* of(int line, std::size_t which) { return links_.data() + first_of(line, which); }
  const std::uint8_t* of(int line, std::size_t which) const { return links_.data() + first_of(line, which); }

  std::size_t bytes_ = 0;  // a row
  int lines_ = 0;
  std::vector<std::uint8_t> links_;
};

void find_links(const DecodedGrid& grid, const ColumnScale& scale, WorkerPool& pool, GridLinks& out);

/// The columns of a line and those around it, and the standard deviations of its and the next one's.
struct ColumnRows {
  const float *above, *here, *below, *further;
  const float *sigma_here, *sigma_below;
};

struct LinkKernels {
  const char* name;

  /// Links of `count` boundaries, and none for up to 7 more. Rows are as those of a DecodedGrid.
  void (*find)(const ColumnRows& rows, const ColumnScale& scale, int count, const LinkRow& out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<LinkKernels>& all_link_kernels();

/// The best that runs on this machine.
const LinkKernels& link_kernels();

}  // namespace relievo
