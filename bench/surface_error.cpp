// SPDX-License-Identifier: Apache-2.0
#include "bench/surface_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/lens.h"

namespace relievo::bench {
namespace {

constexpr std::int64_t kNowhere = -1;

std::int64_t place(std::int64_t line, std::int64_t boundary, const Pattern& pattern) {
  return line * pattern.boundaries() + boundary;
}

/// Line and boundary of a vertex as one number. kNowhere where camera or projector do not see it. Its texture
/// coordinates tell the line exactly, but not the boundary, of which two may be seen at one place; lines lie
/// too close for the positions of coarse codecs.
std::int64_t place_of(const Surface& surface, std::size_t vertex, const Rig& rig, const Pattern& pattern) {
  const Vec3f& p = surface.positions[vertex];
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  const double x = p[0], y = p[1], z = p[2];
  const double qx = r[0] * x + r[1] * y + r[2] * z + t[0];
  const double qy = r[3] * x + r[4] * y + r[5] * z + t[1];
  const double qz = r[6] * x + r[7] * y + r[8] * z + t[2];
  if (!(z > 0 && qz > 0)) return kNowhere;
  const double row =
      surface.texture_coordinates.empty()
          ? distort(rig.camera, x / z, y / z)[1]
          : static_cast<double>(surface.texture_coordinates[vertex][1]) * rig.camera.height - 0.5;
  const double column = distort(rig.projector, qx / qz, qy / qz)[0];
  const long line = std::lround(row / (rig.scan == Scan::kInterlaced ? 2 : 1));
  const long boundary = std::lround((column + 0.5) * pattern.stripes() / rig.projector.width) - 1;
  if (line < 0 || line >= rig.camera.height || boundary < 0 || boundary >= pattern.boundaries())
    return kNowhere;
  return place(line, boundary, pattern);
}

}  // namespace

Result<SurfaceError> surface_error(const Surface& encoded, const Surface& decoded, const Rig& rig,
                                   const Pattern& pattern) {
  if (encoded.positions.empty() || decoded.positions.empty() ||
      encoded.grid.size() != encoded.positions.size() ||
      (!decoded.texture_coordinates.empty() &&
       decoded.texture_coordinates.size() != decoded.positions.size()))
    return Error{"a surface without vertices or without a grid cannot be compared"};
  std::vector<std::int64_t> vertex_at(static_cast<std::size_t>(place(rig.camera.height, 0, pattern)),
                                      kNowhere);
  for (std::size_t v = 0; v < encoded.grid.size(); ++v) {
    const std::int64_t at = place(encoded.grid[v].line, encoded.grid[v].boundary, pattern);
    if (at < std::ssize(vertex_at)) vertex_at[static_cast<std::size_t>(at)] = static_cast<std::int64_t>(v);
  }
  SurfaceError error;
  double squares = 0;
  for (std::size_t i = 0; i < decoded.positions.size(); ++i) {
    const std::int64_t at = place_of(decoded, i, rig, pattern);
    const std::int64_t match = at != kNowhere ? vertex_at[static_cast<std::size_t>(at)] : kNowhere;
    if (match == kNowhere)
      return Error{"vertex " + std::to_string(i) + " that was decoded was never encoded"};
    const Vec3f& a = encoded.positions[static_cast<std::size_t>(match)];
    const Vec3f& b = decoded.positions[i];
    double square = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double d = static_cast<double>(a[c]) - static_cast<double>(b[c]);
      square += d * d;
    }
    squares += square;
    error.max_m = std::max(error.max_m, std::sqrt(square));
  }
  error.rms_m = std::sqrt(squares / static_cast<double>(decoded.positions.size()));
  return error;
}

}  // namespace relievo::bench
