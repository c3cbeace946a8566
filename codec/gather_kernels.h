// SPDX-License-Identifier: Apache-2.0
// What of to_grid() takes every vertex or triangle: as GridKernels, a portable reference and others with the
// same results.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "base/frame3d.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// A place's boundary and line in one number: the bytes in which GridPoint keeps them.
inline std::uint32_t place_key(const GridPoint& at) {
  static_assert(offsetof(GridPoint, boundary) == 0 && offsetof(GridPoint, line) == 2 &&
                std::endian::native == std::endian::little);
  std::uint32_t key;
  std::memcpy(&key, &at, sizeof key);
  return key;
}
constexpr std::uint32_t kRightKey = 1, kBelowKey = 1U << 16;  // from a place's key to its neighbours'

/// Of vertices' positions.
enum class Reach { kNear, kFar, kNotFinite };

enum class Gathered { kAll, kOutside, kTwice };

/// Vertices on their way to a grid.
struct GatherVertices {
  std::span<const GridPoint> points;
  StripeGrid& grid;
  int lines;              // of the grid, that they may lie on
  float steps, width_px;  // of a pixel; columns are below the width
  /// Of each vertex, 1: the next one lies right of it. kSpareRight longer than there are vertices.
  std::uint8_t* right;
};
constexpr std::size_t kSpareRight = 8;

/// Filled cells that follow one on its line, of vertices numbered one after the other.
struct FilledRun {
  std::span<const Triangle> triangles;  // from the first cell's on
  const std::uint8_t* right;            // as GatherVertices has it
  std::uint32_t upper, lower;           // left corners of the first cell
  std::uint8_t* cell;                   // where it is kept
};

struct GatherKernels {
  const char* name;
  /// Columns of all vertices, to the nearest step, and `right`. Stops at the first vertex that is outside or
  /// at a place that is taken.
  Gathered (*vertices)(const GatherVertices& job);
  /// Whether a vertex is not nearer than that.
  Reach (*reach)(std::span<const Vec3f> positions, float farthest_m);
  /// How many filled cells there are, which are told their diagonal.
  std::size_t (*fill_run)(const FilledRun& run);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<GatherKernels>& all_gather_kernels();

/// The best that runs on this machine.
const GatherKernels& gather_kernels();

}  // namespace relievo
