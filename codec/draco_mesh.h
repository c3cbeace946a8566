// SPDX-License-Identifier: Apache-2.0
// Geometry codec 1: a surface as one Draco stream, an edgebreaker mesh or, without triangles, a point cloud.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/stream.h"
#include "codec/frame3d_codec.h"

namespace relievo {

struct EncodedGeometry {
  Bytes bytes;                      // empty where nothing is left to send
  std::uint32_t vertices = 0;       // as the decoder will return them
  std::uint32_t triangles = 0;      //
  Volume volume;                    // used for quantisation
  std::vector<std::uint32_t> sent;  // indices of the vertices that are in it, rising
  // What Draco calls the attributes ("unique ids"); -1: not there.
  int position_id = -1;
  int coordinate_id = -1;
  int normal_id = -1;
};

/// Left out: vertices outside the volume and the triangles on them, triangles that use a vertex twice, and,
/// where the surface has triangles, vertices of none. Vertices at a non-manifold place are split. Fails on
/// positions, normals or texture coordinates that are not finite, on an index outside the vertices, and on
/// vectors of unequal length. Deterministic. Any thread.
Result<EncodedGeometry> encode_draco(const Surface& surface, const EncodeOptions& options);

/// Any bytes. Fails unless the stream declares and holds exactly `vertices` and `triangles`; that is checked
/// before anything as large is allocated. Any thread.
Result<Surface> decode_draco(std::span<const std::uint8_t> bytes, std::uint32_t vertices,
                             std::uint32_t triangles);

}  // namespace relievo
