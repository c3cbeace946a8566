// SPDX-License-Identifier: Apache-2.0
// Points with colour: PLY in and out, and distances from one cloud to another.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/frame3d.h"
#include "base/result.h"

namespace relievo {

struct PointCloud {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint8_t, 3>> colours;  // empty or as long as positions
};

/// The vertices of a PLY, ASCII or binary little endian; faces, other properties and points that are
/// not finite (scanners' way to say none) are skipped. The error names the file.
Result<PointCloud> read_ply_points(const std::filesystem::path& file);

/// Binary little endian; written whole or not at all. The error names the file.
Status write_ply_points(const std::filesystem::path& file, const PointCloud& cloud);

/// How far points lie from their middle, median; 0 of none.
float spread_of(const std::vector<Vec3f>& points);

/// For each point of `points` the distance to the nearest of `reference`; infinite where `reference` is
/// empty. Exact.
std::vector<float> nearest_distances(const std::vector<Vec3f>& points, const std::vector<Vec3f>& reference);

}  // namespace relievo
