// SPDX-License-Identifier: Apache-2.0
// What lines show a second time (second_places.h) as part of the surface: a second layer of its grid, joined
// to the first where one surface goes on from one to the other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/frame3d.h"
#include "capture/reconstruct/column_grid.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/margin_grid.h"
#include "capture/reconstruct/second_places.h"
#include "capture/reconstruct/surface.h"
#include "capture/reconstruct/triangulate.h"

namespace relievo {

/// Keeps its memory from frame to frame. One thread.
class SecondSurface {
 public:
  /// Adds vertices and triangles to `out`, the surface of `first`, behind those that it has; options.picture
  /// must not be null. Places without a triangle are left out. Returns how many those were.
  std::size_t add(const std::vector<SecondPlace>& places, const DecodedGrid& first, const ColumnScale& scale,
                  const SurfaceOptions& options, const Triangulator& triangulator, Surface& out);

 private:
  void add_vertices(const std::vector<SecondPlace>& places, const SurfacePicture& picture,
                    const Triangulator& triangulator, Surface& out);
  std::uint32_t vertex(int line, int boundary, const Surface& surface) const;
  void add_cell(int line, int boundary, const ColumnScale& scale, const SurfaceOptions& options,
                Surface& out);
  std::size_t drop_alone(Surface& out);

  std::uint32_t first_ = 0;             // vertices that are no second places
  MarginGrid<std::uint32_t, 1> index_;  // of second places' vertices
  std::vector<std::uint32_t> now_;      // of a second place's vertex
};

}  // namespace relievo
