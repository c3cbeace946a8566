// SPDX-License-Identifier: Apache-2.0
// Frames as files that other programs open. Every file appears whole or not at all and replaces one of
// its name. Surfaces are as check_surface() wants them; missing normals are derived from the triangles.
#pragma once

#include <filesystem>
#include <memory>

#include "base/frame3d.h"
#include "base/result.h"
#include "base/rig.h"
#include "base/stream.h"

namespace relievo {

/// Binary little-endian PLY: x y z and nx ny nz (float, metres, the camera frame: x right, y down, z
/// forward), red green blue (uchar, the texture bilinearly at the vertex's coordinates; light grey where
/// there is none), where known sigma (float, metres: standard deviation of the depth, 0 not known) and
/// interpolated (uchar, 0 or 1), faces as uchar-counted ints.
Status write_ply(const std::filesystem::path& path, const Surface& surface, View8 texture);

struct GlbOptions {
  int jpeg_quality = 90;  // 1..100
  // Surfaces of triangles by KHR_draco_mesh_compression: positions on multiples of 1, 2, 4, 8 .. micrometres,
  // the same grid for frames of about a size, so that what stands still does; at most half a step off,
  // 1/16,000 of the surface's longest edge or half a micrometre. Vertices of no triangle, _SIGMA and
  // _INTERPOLATED stay out. Surfaces of points alone, for which the extension has no place, stay as they are.
  bool draco = false;
};

/// glTF 2.0 binary: uncompressed attributes, the texture as an embedded JPEG, an unlit material (the light is
/// in the texture), _SIGMA and _INTERPOLATED of each vertex where known (floats). Metres, turned by half a
/// turn about x into glTF's axes: x right, y up, z backward.
Status write_glb(const std::filesystem::path& path, const Frame3D& frame, const GlbOptions& options = {});

/// The bytes of that file.
Result<Bytes> encode_glb(const Frame3D& frame, const GlbOptions& options = {});

/// Frames one after the other in one GLB, which any player of glTF animations plays: a node a frame, as
/// write_glb() makes it, there from the frame's time to the next one's, the last one as long as the one
/// before. One thread.
class GlbAnimation {
 public:
  GlbAnimation();
  ~GlbAnimation();

  /// Each later than the one before. Fails beyond 4 GiB, which is all that a GLB holds; memory grows with the
  /// file.
  Status add(const Frame3D& frame, const GlbOptions& options = {});
  /// The bytes of the file; nothing can be added any more. The last frame stays.
  Result<Bytes> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Wavefront OBJ in glTF's axes; with a texture also NAME.mtl and NAME.png beside it (written first).
Status write_obj(const std::filesystem::path& path, const Frame3D& frame);

/// RGB, RGBA or grey picture, 8 bits.
Status write_png(const std::filesystem::path& path, View8 picture);

/// The camera without its lens distortion: pictures that are read as a pinhole's.
PinholeModel pinhole_of(const PinholeModel& camera);

/// Grey PNG of 16 bits, of the camera's size: z of the nearest surface on the ray through each pixel's centre
/// ((0, 0) is that of the first one), in units of `unit_m`, rounded; 0 where there is none, or none below
/// 65,536 units. Of triangles; points alone give nothing. `camera` has no distortion (pinhole_of()).
Status write_depth_png(const std::filesystem::path& path, const Surface& surface, const PinholeModel& camera,
                       double unit_m);

/// The picture as a pinhole sees it, as write_depth_png() does; black where the camera does not see.
Image8 straightened(View8 picture, const PinholeModel& camera);

/// What such pictures mean, as JSON: width, height, fx, fy, cx, cy, skew, depth_unit_m, depth_scale (units a
/// metre).
Status write_camera_json(const std::filesystem::path& path, const PinholeModel& camera, double unit_m);

}  // namespace relievo
