// SPDX-License-Identifier: Apache-2.0
// One frame as a file that other programs open. Every file appears whole or not at all and replaces one of
// its name. Surfaces are as check_surface() wants them; missing normals are derived from the triangles.
#pragma once

#include <filesystem>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/stream.h"

namespace relievo {

/// Binary little-endian PLY: x y z and nx ny nz (float, metres, the camera frame: x right, y down, z
/// forward), red green blue (uchar, the texture bilinearly at the vertex's coordinates; light grey where
/// there is none), where known sigma (float, metres: standard deviation of the depth, 0 not known) and
/// interpolated (uchar, 0 or 1), faces as uchar-counted ints.
Status write_ply(const std::filesystem::path& path, const Surface& surface, View8 texture);

/// glTF 2.0 binary: uncompressed attributes, the texture as an embedded JPEG, an unlit material (the light is
/// in the texture), _SIGMA and _INTERPOLATED of each vertex where known (floats). Metres, turned by half a
/// turn about x into glTF's axes: x right, y up, z backward.
Status write_glb(const std::filesystem::path& path, const Frame3D& frame, int jpeg_quality = 90);

/// The bytes of that file.
Result<Bytes> encode_glb(const Frame3D& frame, int jpeg_quality = 90);

/// Wavefront OBJ in glTF's axes; with a texture also NAME.mtl and NAME.png beside it (written first).
Status write_obj(const std::filesystem::path& path, const Frame3D& frame);

/// RGB, RGBA or grey picture, 8 bits.
Status write_png(const std::filesystem::path& path, View8 picture);

}  // namespace relievo
