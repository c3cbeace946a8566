// SPDX-License-Identifier: Apache-2.0
// A surface's vertices and triangles, line by line, once it is known which of them stay.
#pragma once

#include "base/frame3d.h"
#include "capture/reconstruct/surface.h"

namespace relievo {

/// One worker's. Writes what options.picture asks for, too.
class SurfaceWriter {
 public:
  /// Makes `out` as large as what `pieces` keeps on `lines`.
  static void fit(const SurfacePieces& pieces, int lines, const SurfaceOptions& options, Surface& out);

  /// `scratch` must hold the normals of `grid` and which of its places stay.
  SurfaceWriter(const DecodedGrid& grid, const SurfaceOptions& options, const SurfaceScratch& scratch,
                SurfaceScratch::Worker& worker, Surface& out);

  /// Lines [begin, end).
  void write(int begin, int end);

 private:
  /// In whole words of places, and one more.
  std::size_t index_size() const { return 64 * scratch_.pieces.words() + 1; }
  void number(int line, std::int32_t* index) const;
  void prepare(int line);
  void write_vertices(int line);
  void write_triangles(int line, const std::int32_t* above, const std::int32_t* below);

  const DecodedGrid& grid_;
  const SurfaceOptions& options_;
  const SurfaceScratch& scratch_;
  SurfaceScratch::Worker& worker_;
  Surface& out_;
  float *texture_x_, *sigma_m_;  // of the line being written
};

}  // namespace relievo
