// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/triangulate_rows.h"

#include <cstdint>
#include <cstring>

#include "base/variants.h"
#include "capture/reconstruct/four.h"

namespace relievo {
namespace {

// Boundaries at once; a processor with narrower registers takes several for the doubles.
using FourDoubles = double __attribute__((vector_size(32)));
using FourLongs = std::int64_t __attribute__((vector_size(32)));  // as a mask: 0 or -1

#define RELIEVO_INLINE [[gnu::always_inline]] inline

RELIEVO_INLINE void load(const float* from, Four& to) {
  std::memcpy(&to, from, sizeof to);
}
RELIEVO_INLINE void store(const Four& from, float* to) {
  std::memcpy(to, &from, sizeof from);
}

/// Ray samples on both sides of four columns, from [x, y, x, y] of each.
RELIEVO_INLINE void transpose(const Four (&at)[4], Four& x0, Four& y0, Four& x1, Four& y1) {
  const Four ab0 = __builtin_shufflevector(at[0], at[1], 0, 4, 1, 5);
  const Four cd0 = __builtin_shufflevector(at[2], at[3], 0, 4, 1, 5);
  const Four ab1 = __builtin_shufflevector(at[0], at[1], 2, 6, 3, 7);
  const Four cd1 = __builtin_shufflevector(at[2], at[3], 2, 6, 3, 7);
  x0 = __builtin_shufflevector(ab0, cd0, 0, 1, 4, 5);
  y0 = __builtin_shufflevector(ab0, cd0, 2, 3, 6, 7);
  x1 = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
  y1 = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
}

RELIEVO_INLINE void straight_body(const StraightSheets& s, int count, float* column_px, const PointRow& out,
                                  PointCounts& counts) {
  const Four none = {kNoColumn, kNoColumn, kNoColumn, kNoColumn};
  const auto last = static_cast<float>(s.ray_samples - 2);
  const Four first_sample{};
  const Four last_sample = {last, last, last, last};
  FourInts points{};  // negative
  FourInts no_point{};
  for (int b = 0; b < count; b += 4) {
    Four column;
    load(column_px + b, column);
    // The ray: linear between samples, and beyond the outermost.
    const Four at = column / static_cast<float>(kRayStep);
    Four floor = at > first_sample ? at : first_sample;  // also where there is none
    floor = floor < last_sample ? floor : last_sample;
    const FourInts sample = __builtin_convertvector(floor, FourInts);
    const Four f = at - __builtin_convertvector(sample, Four);
    Four beside[4];
    for (int i = 0; i < 4; ++i) load(s.rays + 2 * sample[i], beside[i]);
    Four x0, y0, x1, y1;
    transpose(beside, x0, y0, x1, y1);
    const Four ray_x = x0 + f * (x1 - x0);
    const Four ray_y = y0 + f * (y1 - y0);

    const FourDoubles rx = __builtin_convertvector(ray_x, FourDoubles);
    const FourDoubles ry = __builtin_convertvector(ray_y, FourDoubles);
    Four sheet;
    load(s.sheets + b, sheet);
    const FourDoubles x = __builtin_convertvector(sheet, FourDoubles);
    // As in find().
    const FourDoubles dx = s.across[0] * rx + s.across[1] * ry + s.across[2];
    const FourDoubles dz = s.forward[0] * rx + s.forward[1] * ry + s.forward[2];
    const FourDoubles denominator = dx - x * dz;
    const FourDoubles z = (x * s.translation_z - s.translation_x) / denominator;
    const FourDoubles depth = z * dz + s.translation_z;
    const FourLongs meet = (denominator >= kLeastCrossing) | (denominator <= -kLeastCrossing);
    const FourLongs good = meet & (z > 0.0) & (depth > 0.0);
    const FourInts kept = __builtin_convertvector(good, FourInts);
    points += kept;
    no_point += (column == column) & ~kept;
    store(kept ? column : none, column_px + b);
    store(kept ? __builtin_convertvector(z * rx, Four) : none, out.x + b);
    store(kept ? __builtin_convertvector(z * ry, Four) : none, out.y + b);
    store(kept ? __builtin_convertvector(z, Four) : none, out.z + b);
  }
  for (int i = 0; i < 4; ++i) {
    counts.points += static_cast<std::size_t>(-points[i]);
    counts.no_point += static_cast<std::size_t>(-no_point[i]);
  }
}
#undef RELIEVO_INLINE

PointCounts straight_portable(const StraightSheets& sheets, int count, float* column_px,
                              const PointRow& out) {
  PointCounts counts;
  straight_body(sheets, count, column_px, out, counts);
  return counts;
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] PointCounts straight_avx2(const StraightSheets& sheets, int count, float* column_px,
                                                  const PointRow& out) {
  PointCounts counts;
  straight_body(sheets, count, column_px, out, counts);
  return counts;
}
#endif

}  // namespace

const std::vector<TriangulateKernels>& all_triangulate_kernels() {
  const TriangulateKernels portable{"portable", straight_portable};
#if defined(__x86_64__)
  static const auto kernels = variants(portable, {"avx2", straight_avx2});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const TriangulateKernels& triangulate_kernels() {
  return all_triangulate_kernels().back();
}

}  // namespace relievo
