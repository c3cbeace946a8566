// SPDX-License-Identifier: Apache-2.0
// Triangle meshes as files: PLY (ascii, little and big endian) and OBJ with its material's texture.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "capture/source/sim/vec.h"

namespace relievo::sim {

struct MeshFile {
  std::vector<Vec3> positions;
  std::vector<Vec3> colours;  // 0..1, one a position, or empty
  std::vector<std::array<float, 2>>
      corner_texture;  // three a triangle, (0, 0) the lower left corner, or empty
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Image8 texture;  // RGB, or empty
};

/// By the name's extension. Polygons are cut into fans. Errors name the file and what is wrong with it;
/// indices in what is returned are valid, positions finite, and there is a triangle
/// with an area.
Result<MeshFile> read_mesh(const std::filesystem::path& file);

}  // namespace relievo::sim
