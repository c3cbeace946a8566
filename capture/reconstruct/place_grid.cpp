// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/place_grid.h"

#include <algorithm>

namespace relievo {

void PlaceGrid::fill(int boundaries, WorkerPool& pool, const SequenceResult& result, const EdgeImage& edges,
                     const std::vector<RecoveredBoundary>& recovered) {
  // What lies around the lines stays as it is here.
  if (boundaries != this->boundaries() || edges.lines != lines()) reset(boundaries, edges.lines, {});
  pool.for_shares(edges.line_start, [&](int begin, int end, int) {
    for (int l = begin; l < end; ++l) {
      Place* here = line(l);
      std::fill_n(here, boundaries, Place{});
      for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(l)];
           e < edges.line_start[static_cast<std::size_t>(l) + 1]; ++e)
        if (result.boundary[e] >= 0)
          here[result.boundary[e]] = {edges.edges[e].column_px, edges.edges[e].sigma_px};
    }
  });
  for (const RecoveredBoundary& r : recovered) line(r.line)[r.boundary] = {r.column_px, r.sigma_px};
}

void PlaceGrid::fill(int boundaries, WorkerPool& pool, ConsistencyCheck& checked) {
  if (boundaries != this->boundaries() || checked.lines() != lines()) reset(boundaries, checked.lines(), {});
  pool.for_ranges(lines(), [&](int begin, int end, int) {
    for (int l = begin; l < end; ++l) {
      const float* column_px = checked.settled_px(l);
      const float* sigma_px = checked.row(l).sigma_px;
      Place* here = line(l);
      for (int b = 0; b < boundaries; ++b) here[b] = {column_px[b], sigma_px[b]};
    }
  });
}

}  // namespace relievo
