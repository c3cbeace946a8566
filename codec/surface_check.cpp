// SPDX-License-Identifier: Apache-2.0
#include "codec/surface_check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>

#include "base/variants.h"

namespace relievo {
namespace {

#define RELIEVO_INLINE [[gnu::always_inline]] inline

// All numbers, without a way out between, by their bits: several at a time.

RELIEVO_INLINE bool all_finite_body(const float* numbers, std::size_t count) {
  constexpr std::uint32_t kExponent = 0x7f800000U;
  std::uint32_t worst = 0;
  for (std::size_t i = 0; i < count; ++i)
    worst |= (std::bit_cast<std::uint32_t>(numbers[i]) & kExponent) == kExponent ? 1U : 0U;
  return worst == 0;
}

/// Finite and not below 0, which may have a sign.
RELIEVO_INLINE bool all_lengths_body(const float* numbers, std::size_t count) {
  constexpr std::uint32_t kInfinity = 0x7f800000U, kMinus0 = 0x80000000U;
  std::uint32_t worst = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto bits = std::bit_cast<std::uint32_t>(numbers[i]);
    worst |= (bits == kMinus0 ? 0U : bits) >= kInfinity ? 1U : 0U;
  }
  return worst == 0;
}

struct Kernels {
  bool (*all_finite)(const float* numbers, std::size_t count);
  bool (*all_lengths)(const float* numbers, std::size_t count);
};

#define RELIEVO_KERNELS(set, attributes)                                          \
  struct set {                                                                    \
    attributes static bool all_finite(const float* numbers, std::size_t count) {  \
      return all_finite_body(numbers, count);                                     \
    }                                                                             \
    attributes static bool all_lengths(const float* numbers, std::size_t count) { \
      return all_lengths_body(numbers, count);                                    \
    }                                                                             \
    static Kernels table() { return {all_finite, all_lengths}; }                  \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

const Kernels& kernels() {
#if defined(__x86_64__)
  static const Kernels best = variants(Portable::table(), Avx2::table()).back();
#else
  static const Kernels best = Portable::table();
#endif
  return best;
}

template <std::size_t N>
bool all_finite(const std::vector<std::array<float, N>>& values) {
  return values.empty() || kernels().all_finite(values.front().data(), N * values.size());
}

std::uint32_t largest_index(const std::vector<Triangle>& triangles) {
  std::uint32_t largest = 0;
  const std::uint32_t* index = triangles.empty() ? nullptr : triangles.front().data();
  for (std::size_t i = 0; i < 3 * triangles.size(); ++i) largest = std::max(largest, index[i]);
  return largest;
}

/// False, and unchanged, where there is no direction.
bool normalise(Vec3f& v) {
  const double length = std::hypot(v[0], v[1], v[2]);
  if (!(length > 0)) return false;
  for (float& x : v) x = static_cast<float>(x / length);
  return true;
}

}  // namespace

Status check_counts(const Surface& surface) {
  const std::size_t count = surface.positions.size();
  const auto matches = [count](std::size_t size) { return size == 0 || size == count; };
  if (!matches(surface.normals.size()) || !matches(surface.texture_coordinates.size()))
    return Error{"surface has " + std::to_string(count) + " positions, but " +
                 std::to_string(surface.normals.size()) + " normals and " +
                 std::to_string(surface.texture_coordinates.size()) +
                 " texture coordinates: give none or one a vertex"};
  if (!matches(surface.sigmas_m.size()) || !matches(surface.interpolated.size()))
    return Error{"surface has " + std::to_string(count) + " positions, but " +
                 std::to_string(surface.sigmas_m.size()) + " sigmas and " +
                 std::to_string(surface.interpolated.size()) +
                 " marks of interpolation: give none or one a vertex"};
  return {};
}

Status check_surface(const Surface& surface) {
  if (Status status = check_counts(surface); !status) return status;
  if (!kernels().all_lengths(surface.sigmas_m.data(), surface.sigmas_m.size()))
    return Error{"surface has a sigma that is no length in metres"};
  if (!all_finite(surface.positions) || !all_finite(surface.normals) ||
      !all_finite(surface.texture_coordinates))
    return Error{"surface has a position, normal or texture coordinate that is not finite"};
  const std::size_t count = surface.positions.size();
  if (const std::uint32_t largest = largest_index(surface.triangles);
      !surface.triangles.empty() && largest >= count)
    return Error{"surface has a triangle on vertex " + std::to_string(largest) + " of " +
                 std::to_string(count)};
  return {};
}

std::vector<Vec3f> surface_normals(const Surface& surface) {
  const std::vector<Vec3f>& p = surface.positions;
  std::vector<Vec3f> normals(p.size(), Vec3f{});
  for (const Triangle& t : surface.triangles) {
    Vec3f a{};
    Vec3f b{};
    for (std::size_t i = 0; i < 3; ++i) {
      a[i] = p[t[1]][i] - p[t[0]][i];
      b[i] = p[t[2]][i] - p[t[0]][i];
    }
    const Vec3f cross{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    for (const std::uint32_t index : t)
      for (std::size_t i = 0; i < 3; ++i) normals[index][i] += cross[i];
  }
  for (std::size_t v = 0; v < normals.size(); ++v) {
    if (normalise(normals[v])) continue;
    normals[v] = {-p[v][0], -p[v][1], -p[v][2]};
    if (!normalise(normals[v])) normals[v] = {0, 0, -1};
  }
  return normals;
}

}  // namespace relievo
