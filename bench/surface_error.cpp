// SPDX-License-Identifier: Apache-2.0
#include "bench/surface_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/lens.h"
#include "base/line_step.h"
#include "capture/reconstruct/detection_lines.h"

namespace relievo::bench {
namespace {

constexpr std::int64_t kNowhere = -1;

constexpr double kSamePlace_px = 1;    // texture coordinates of a vertex before and after coding, at most
constexpr double kOnSheet = 0.01;      // stripes beside a boundary, at most, of one that lies on it
constexpr double kMostOnSheets = 0.9;  // of a surface whose codec keeps boundaries

std::int64_t place(std::int64_t line, std::int64_t boundary, const Pattern& pattern) {
  return line * pattern.boundaries() + boundary;
}

/// Where a vertex lies. Lines lie too close for the positions of coarse codecs, so texture coordinates tell
/// them where there are any; they do not tell the boundary, of which two may be seen at one place.
struct Place {
  std::int64_t line = 0, boundary = 0;  // the nearest one
  double off_boundary = 0;              // stripes
  std::optional<double> column_px;      // in the texture
};

/// Nothing where camera or projector do not see it.
std::optional<Place> place_of(const Surface& surface, std::size_t vertex, const Rig& rig,
                              const Pattern& pattern) {
  const Vec3f& p = surface.positions[vertex];
  const auto& r = rig.projector_from_camera_rotation;
  const auto& t = rig.projector_from_camera_translation;
  const double x = p[0], y = p[1], z = p[2];
  const double qx = r[0] * x + r[1] * y + r[2] * z + t[0];
  const double qy = r[3] * x + r[4] * y + r[5] * z + t[1];
  const double qz = r[6] * x + r[7] * y + r[8] * z + t[2];
  if (!(z > 0 && qz > 0)) return std::nullopt;
  Place out;
  double row = 0;
  if (surface.texture_coordinates.empty()) {
    row = distort(rig.camera, x / z, y / z)[1];
  } else {
    const auto& [u, v] = surface.texture_coordinates[vertex];
    row = static_cast<double>(v) * rig.camera.height - 0.5;
    out.column_px = static_cast<double>(u) * rig.camera.width - 0.5;
  }
  const double column = distort(rig.projector, qx / qz, qy / qz)[0];
  out.line = std::lround(row / line_step_px(rig.scan));
  const double stripes = (column + 0.5) * pattern.stripes() / rig.projector.width;
  out.boundary = std::lround(stripes) - 1;
  out.off_boundary = std::abs(stripes - std::round(stripes));
  if (out.line < 0 || out.line >= rig.camera.height) return std::nullopt;
  return out;
}

/// Whether each vertex lies on a boundary, as it does where a codec sends columns: it may have moved along
/// it, but is no other's.
bool lies_on_sheets(const std::vector<std::optional<Place>>& places) {
  const auto on =
      std::ranges::count_if(places, [](const auto& p) { return p && p->off_boundary <= kOnSheet; });
  return static_cast<double>(on) >= kMostOnSheets * static_cast<double>(places.size());
}

/// The encoded vertex there: of those seen at its column of the texture the one whose boundary is
/// nearest, since stripes may lie closer than a coarse codec's steps. A line may see a boundary twice: second
/// places come `lines` further down. kNowhere where there is none.
std::int64_t match_of(const Place& found, const Surface& encoded, const std::vector<std::int64_t>& vertex_at,
                      const Pattern& pattern, int lines, bool on_sheets) {
  const auto off_px = [&](std::int64_t v) {
    const double column_px = static_cast<double>(encoded.grid[static_cast<std::size_t>(v)].column_px);
    return std::abs(column_px - found.column_px.value_or(column_px));
  };
  const auto at = [&](std::int64_t boundary) {
    if (boundary < 0 || boundary >= pattern.boundaries()) return kNowhere;
    const std::int64_t first = vertex_at[static_cast<std::size_t>(place(found.line, boundary, pattern))];
    const std::int64_t second =
        vertex_at[static_cast<std::size_t>(place(found.line + lines, boundary, pattern))];
    if (first == kNowhere || second == kNowhere) return std::max(first, second);
    return off_px(second) < off_px(first) ? second : first;
  };
  if (on_sheets || !found.column_px) return at(found.boundary);
  const std::int64_t nearest = std::clamp<std::int64_t>(found.boundary, 0, pattern.boundaries() - 1);
  for (std::int64_t off = 0; off < pattern.boundaries(); ++off) {
    for (const std::int64_t boundary : {nearest - off, nearest + off}) {
      const std::int64_t v = at(boundary);
      if (v != kNowhere && off_px(v) <= kSamePlace_px) return v;
    }
  }
  return kNowhere;
}

}  // namespace

Result<SurfaceError> surface_error(const Surface& encoded, const Surface& decoded, const Rig& rig,
                                   const Pattern& pattern) {
  if (encoded.positions.empty() || decoded.positions.empty() ||
      encoded.grid.size() != encoded.positions.size() ||
      (!decoded.texture_coordinates.empty() &&
       decoded.texture_coordinates.size() != decoded.positions.size()))
    return Error{"a surface without vertices or without a grid cannot be compared"};
  std::vector<std::int64_t> vertex_at(static_cast<std::size_t>(place(2 * rig.camera.height, 0, pattern)),
                                      kNowhere);
  for (std::size_t v = 0; v < encoded.grid.size(); ++v) {
    const std::int64_t at = place(encoded.grid[v].line, encoded.grid[v].boundary, pattern);
    if (at < std::ssize(vertex_at)) vertex_at[static_cast<std::size_t>(at)] = static_cast<std::int64_t>(v);
  }
  std::vector<std::optional<Place>> places;
  for (std::size_t i = 0; i < decoded.positions.size(); ++i)
    places.push_back(place_of(decoded, i, rig, pattern));
  const bool on_sheets = lies_on_sheets(places);
  SurfaceError error;
  double squares = 0;
  for (std::size_t i = 0; i < decoded.positions.size(); ++i) {
    const std::int64_t match =
        places[i] ? match_of(*places[i], encoded, vertex_at, pattern, line_count(rig, 1), on_sheets)
                  : kNowhere;
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
