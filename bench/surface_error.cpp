// SPDX-License-Identifier: Apache-2.0
#include "bench/surface_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

namespace relievo::bench {
namespace {

constexpr int kCells = 512;  // a side; a cell is as wide as the search reaches
constexpr float kReach = 1.0F / kCells;

/// Vertices by the cell of the texture that they lie in.
class TextureCells {
 public:
  explicit TextureCells(const std::vector<Vec2f>& coordinates)
      : coordinates_(coordinates), start_(kCells * kCells + 1), vertices_(coordinates.size()) {
    for (const Vec2f& c : coordinates) ++start_[cell(index(c[0]), index(c[1])) + 1];
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
    for (std::uint32_t v = 0; v < coordinates.size(); ++v)
      vertices_[next[cell(index(coordinates[v][0]), index(coordinates[v][1]))]++] = v;
  }

  /// The nearest vertex within kReach, -1: none.
  std::int64_t nearest(const Vec2f& at) const {
    std::int64_t best = -1;
    float best_distance = kReach * kReach;
    const int x = index(at[0]);
    const int y = index(at[1]);
    for (int cy = std::max(0, y - 1); cy <= std::min(kCells - 1, y + 1); ++cy) {
      for (int cx = std::max(0, x - 1); cx <= std::min(kCells - 1, x + 1); ++cx) {
        for (std::uint32_t i = start_[cell(cx, cy)]; i < start_[cell(cx, cy) + 1]; ++i) {
          const Vec2f& c = coordinates_[vertices_[i]];
          const float distance = (c[0] - at[0]) * (c[0] - at[0]) + (c[1] - at[1]) * (c[1] - at[1]);
          if (distance > best_distance) continue;
          best_distance = distance;
          best = vertices_[i];
        }
      }
    }
    return best;
  }

 private:
  static int index(float coordinate) {
    return std::clamp(static_cast<int>(coordinate * kCells), 0, kCells - 1);
  }
  static std::size_t cell(int x, int y) {
    return static_cast<std::size_t>(y) * kCells + static_cast<std::size_t>(x);
  }

  const std::vector<Vec2f>& coordinates_;
  std::vector<std::uint32_t> start_;
  std::vector<std::uint32_t> vertices_;
};

}  // namespace

Result<SurfaceError> surface_error(const Surface& encoded, const Surface& decoded) {
  for (const Surface* surface : {&encoded, &decoded}) {
    if (surface->texture_coordinates.size() != surface->positions.size() || surface->positions.empty())
      return Error{"a surface without vertices or texture coordinates cannot be compared"};
  }
  const TextureCells cells(encoded.texture_coordinates);
  SurfaceError error;
  double squares = 0;
  for (std::size_t i = 0; i < decoded.positions.size(); ++i) {
    const std::int64_t match = cells.nearest(decoded.texture_coordinates[i]);
    if (match < 0) return Error{"vertex " + std::to_string(i) + " that was decoded was never encoded"};
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
