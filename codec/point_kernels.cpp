// SPDX-License-Identifier: Apache-2.0
#include "codec/point_kernels.h"

#include <array>
#include <bit>
#include <cstddef>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/variants.h"
#include "codec/stripe_grid.h"

namespace relievo {
namespace {

constexpr float kFarthest_m = 1e6F;
constexpr std::int32_t kAbsent = StripeGrid::kAbsent;

bool meet_portable(const SheetRow& row, const Sheets& sheets, int count) {
  bool good = true;
  for (int i = 0; i < count; ++i) {
    const float denominator = sheets.a[i] * row.ray_x[i] + sheets.b[i] * row.ray_y[i] + sheets.c[i];
    row.z[i] = sheets.numerator[i] / denominator;
    if (row.slope != nullptr) row.slope[i] = row.z[i] * sheets.a[i] / denominator;
    good &= row.columns[i] == kAbsent || (row.z[i] > 0 && row.z[i] < kFarthest_m);
  }
  return good;
}

[[gnu::always_inline]] inline void straight_rays_body(const std::int32_t* __restrict columns,
                                                      const StraightRays& rays, int count,
                                                      float* __restrict column, float* __restrict x,
                                                      float* __restrict y) {
  for (int i = 0; i < count; ++i) {
    column[i] = static_cast<float>(columns[i]) * rays.step_px;
    x[i] = column[i] * rays.per_px - rays.first;
    y[i] = rays.y;
  }
}

void straight_rays_portable(const std::int32_t* columns, const StraightRays& rays, int count, float* column,
                            float* x, float* y) {
  straight_rays_body(columns, rays, count, column, x, y);
}

std::int32_t number_portable(const std::int32_t* columns, int count, std::int32_t next, std::int32_t* index) {
  for (int b = 0; b < count; ++b) {
    index[b] = next;
    next += columns[b] != kAbsent;
  }
  return next;
}

/// Places [begin, end); the first vertex of them is the n-th of the line. Returns the number after the last.
std::size_t vertices_between(const PlacedRow& row, int begin, int end, std::size_t n) {
  for (int b = begin; b < end; ++b) {
    if (row.columns[b] == kAbsent) continue;
    const float z = row.z[b];
    row.position[n] = {z * row.ray_x[b], z * row.ray_y[b], z};
    row.coordinate[n] = {(row.column_px[b] + 0.5F) * row.per_width, row.v};
    row.place[n] = {static_cast<std::uint16_t>(b), row.line, row.column_px[b], 0, false};
    ++n;
  }
  return n;
}

void vertices_portable(const PlacedRow& row, int count) {
  vertices_between(row, 0, count, 0);
}

/// Triangle without corner c, counter-clockwise; of kStraight and kTurned in this order.
constexpr std::array<int, 4> kOrder{3, 1, 0, 2};

/// Cells [begin, end).
Triangle* triangles_between(const NumberedCells& row, int begin, int end, Triangle* to) {
  const auto index = [](std::int32_t i) { return static_cast<std::uint32_t>(i); };
  for (int b = begin; b < end; ++b) {
    const std::uint8_t cell = row.cells[b];
    if (cell == 0) continue;
    const std::array<std::uint32_t, 4> q{index(row.above[b]), index(row.below[b]), index(row.below[b + 1]),
                                         index(row.above[b + 1])};
    const bool straight = cell == grid_cell::kStraight;
    if (straight || cell == grid_cell::kTurned) {
      // Without branches on the diagonal, which is hard to foresee.
      const std::uint32_t first = straight ? q[0] : q[1];
      const std::uint32_t third = straight ? q[2] : q[3];
      *to++ = {first, straight ? q[1] : q[2], third};
      *to++ = {third, straight ? q[3] : q[0], first};
    } else {
      for (const int lack : kOrder) {
        if ((cell >> lack & 1) == 0) continue;
        const auto c = static_cast<std::size_t>(lack);
        *to++ = {q[(c + 1) & 3U], q[(c + 2) & 3U], q[(c + 3) & 3U]};
      }
    }
  }
  return to;
}

Triangle* triangles_portable(const NumberedCells& row, int count, Triangle* to) {
  return triangles_between(row, 0, count, to);
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

RELIEVO_AVX2 __m256i load_ints(const std::int32_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
RELIEVO_AVX2 __m256i lanes() {
  return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
}
RELIEVO_AVX2 unsigned absent_of(const std::int32_t* columns) {
  const __m256i absent = _mm256_cmpeq_epi32(load_ints(columns), _mm256_set1_epi32(kAbsent));
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(absent)));
}

[[gnu::target("avx2")]] bool meet_avx2(const SheetRow& row, const Sheets& sheets, int count) {
  const __m256 farthest = _mm256_set1_ps(kFarthest_m);
  unsigned bad = 0;
  for (int i = 0; i < count; i += 8) {
    const __m256 a = _mm256_loadu_ps(sheets.a + i);
    const __m256 ax = _mm256_mul_ps(a, _mm256_loadu_ps(row.ray_x + i));
    const __m256 by = _mm256_mul_ps(_mm256_loadu_ps(sheets.b + i), _mm256_loadu_ps(row.ray_y + i));
    const __m256 denominator = _mm256_add_ps(_mm256_add_ps(ax, by), _mm256_loadu_ps(sheets.c + i));
    const __m256 z = _mm256_div_ps(_mm256_loadu_ps(sheets.numerator + i), denominator);
    _mm256_storeu_ps(row.z + i, z);
    if (row.slope != nullptr)
      _mm256_storeu_ps(row.slope + i, _mm256_div_ps(_mm256_mul_ps(z, a), denominator));
    const __m256 in_front = _mm256_and_ps(_mm256_cmp_ps(z, _mm256_setzero_ps(), _CMP_GT_OQ),
                                          _mm256_cmp_ps(z, farthest, _CMP_LT_OQ));
    bad |= ~(static_cast<unsigned>(_mm256_movemask_ps(in_front)) | absent_of(row.columns + i)) & 0xffU;
  }
  return bad == 0;
}

[[gnu::target("avx2")]] void straight_rays_avx2(const std::int32_t* columns, const StraightRays& rays,
                                                int count, float* column, float* x, float* y) {
  straight_rays_body(columns, rays, count, column, x, y);
}

[[gnu::target("avx2")]] std::int32_t number_avx2(const std::int32_t* columns, int count, std::int32_t next,
                                                 std::int32_t* index) {
  for (int b = 0; b < count; b += 8) {
    const unsigned absent = absent_of(columns + b);
    if (absent != 0 && absent != 0xffU) {
      next = number_portable(columns + b, 8, next, index + b);
      continue;
    }
    const __m256i first = _mm256_set1_epi32(next);
    const __m256i here = absent == 0 ? _mm256_add_epi32(first, lanes()) : first;
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(index + b), here);
    next += absent == 0 ? 8 : 0;
  }
  return next;
}

/// Eight vectors x y z, one after the other.
RELIEVO_AVX2 void store_positions(__m256 x, __m256 y, __m256 z, float* to) {
  const __m256 xy = _mm256_shuffle_ps(x, y, _MM_SHUFFLE(2, 0, 2, 0));
  const __m256 yz = _mm256_shuffle_ps(y, z, _MM_SHUFFLE(3, 1, 3, 1));
  const __m256 zx = _mm256_shuffle_ps(z, x, _MM_SHUFFLE(3, 1, 2, 0));
  const __m256 parts[3] = {_mm256_shuffle_ps(xy, zx, _MM_SHUFFLE(2, 0, 2, 0)),
                           _mm256_shuffle_ps(yz, xy, _MM_SHUFFLE(3, 1, 2, 0)),
                           _mm256_shuffle_ps(zx, yz, _MM_SHUFFLE(3, 1, 3, 1))};
  for (int i = 0; i < 3; ++i) {
    _mm_storeu_ps(to + 4 * i, _mm256_castps256_ps128(parts[i]));
    _mm_storeu_ps(to + 12 + 4 * i, _mm256_extractf128_ps(parts[i], 1));
  }
}

/// Eight pairs of a number and another, which is the same for all.
RELIEVO_AVX2 void store_coordinates(__m256 u, __m256 v, float* to) {
  const __m256 low = _mm256_unpacklo_ps(u, v), high = _mm256_unpackhi_ps(u, v);
  _mm256_storeu_ps(to, _mm256_permute2f128_ps(low, high, 0x20));
  _mm256_storeu_ps(to + 8, _mm256_permute2f128_ps(low, high, 0x31));
}

RELIEVO_AVX2 void store_places(__m256i keys, __m256 column_px, GridPoint* to) {
  static_assert(sizeof(GridPoint) == 16 && offsetof(GridPoint, line) == 2 &&
                offsetof(GridPoint, column_px) == 4);
  const __m256i columns = _mm256_castps_si256(column_px), zero = _mm256_setzero_si256();
  const __m256i low = _mm256_unpacklo_epi32(keys, columns), high = _mm256_unpackhi_epi32(keys, columns);
  const __m256i places[4] = {_mm256_unpacklo_epi64(low, zero), _mm256_unpackhi_epi64(low, zero),
                             _mm256_unpacklo_epi64(high, zero), _mm256_unpackhi_epi64(high, zero)};
  auto* place = reinterpret_cast<__m128i*>(to);
  for (int i = 0; i < 4; ++i) {
    _mm_storeu_si128(place + i, _mm256_castsi256_si128(places[i]));
    _mm_storeu_si128(place + 4 + i, _mm256_extracti128_si256(places[i], 1));
  }
}

[[gnu::target("avx2")]] void vertices_avx2(const PlacedRow& row, int count) {
  const __m256 per_width = _mm256_set1_ps(row.per_width), v = _mm256_set1_ps(row.v);
  std::size_t n = 0;
  for (int b = 0; b < count; b += 8) {
    const unsigned absent = absent_of(row.columns + b);
    if (absent != 0) {
      if (absent != 0xffU) n = vertices_between(row, b, b + 8, n);
      continue;
    }
    const __m256 z = _mm256_loadu_ps(row.z + b), column_px = _mm256_loadu_ps(row.column_px + b);
    store_positions(_mm256_mul_ps(z, _mm256_loadu_ps(row.ray_x + b)),
                    _mm256_mul_ps(z, _mm256_loadu_ps(row.ray_y + b)), z, row.position[n].data());
    const __m256 u = _mm256_mul_ps(_mm256_add_ps(column_px, _mm256_set1_ps(0.5F)), per_width);
    store_coordinates(u, v, row.coordinate[n].data());
    const __m256i first = _mm256_set1_epi32(static_cast<std::int32_t>(row.line) << 16 | b);
    store_places(_mm256_add_epi32(first, lanes()), column_px, row.place + n);
    n += 8;
  }
}

/// Four filled cells at a time, whose vertices are numbered one after the other.
[[gnu::target("avx2")]] Triangle* triangles_avx2(const NumberedCells& row, int count, Triangle* to) {
  constexpr std::uint32_t kFourOnes = 0x01010101U;
  static_assert((grid_cell::kTurned ^ grid_cell::kStraight) == 15);
  // Which corners above (one each) and below come in two triangles a cell: straight u l l+1 | l+1 u+1 u,
  // turned l l+1 u+1 | u+1 u l; and how far right they are.
  const __m256i straight_above[3] = {_mm256_setr_epi32(-1, 0, 0, 0, -1, -1, -1, 0),
                                     _mm256_setr_epi32(0, 0, -1, -1, -1, 0, 0, 0),
                                     _mm256_setr_epi32(-1, -1, -1, 0, 0, 0, -1, -1)};
  const __m256i straight_right[3] = {_mm256_setr_epi32(0, 0, 1, 1, 1, 0, 1, 1),
                                     _mm256_setr_epi32(2, 2, 2, 1, 2, 2, 3, 3),
                                     _mm256_setr_epi32(3, 2, 3, 3, 4, 4, 4, 3)};
  const __m256i turned_above[3] = {_mm256_setr_epi32(0, 0, -1, -1, -1, 0, 0, 0),
                                   _mm256_setr_epi32(-1, -1, -1, 0, 0, 0, -1, -1),
                                   _mm256_setr_epi32(-1, 0, 0, 0, -1, -1, -1, 0)};
  const __m256i turned_right[3] = {_mm256_setr_epi32(0, 1, 1, 1, 0, 0, 1, 2),
                                   _mm256_setr_epi32(2, 2, 1, 1, 2, 3, 3, 3),
                                   _mm256_setr_epi32(2, 2, 3, 4, 4, 4, 3, 3)};
  // Which cell a number is of, as the bit of its kind.
  const __m256i cell_of[3] = {
      _mm256_setr_epi32(1, 1, 1, 1, 1, 1, 1 << 8, 1 << 8),
      _mm256_setr_epi32(1 << 8, 1 << 8, 1 << 8, 1 << 8, 1 << 16, 1 << 16, 1 << 16, 1 << 16),
      _mm256_setr_epi32(1 << 16, 1 << 16, 1 << 24, 1 << 24, 1 << 24, 1 << 24, 1 << 24, 1 << 24)};
  int b = 0;
  for (; b + 4 <= count; b += 4) {
    std::uint32_t kinds;
    std::memcpy(&kinds, row.cells + b, sizeof kinds);
    if (kinds == 0) continue;
    kinds ^= grid_cell::kTurned * kFourOnes;  // 15 where straight, 0 where turned
    const std::uint32_t straight = kinds & kFourOnes;
    if (kinds != 15 * straight || row.above[b + 4] != row.above[b] + 4 ||
        row.below[b + 4] != row.below[b] + 4) {
      to = triangles_between(row, b, b + 4, to);
      continue;
    }
    const __m256i above = _mm256_set1_epi32(row.above[b]), below = _mm256_set1_epi32(row.below[b]);
    const __m256i which = _mm256_set1_epi32(static_cast<std::int32_t>(straight));
    auto* out = reinterpret_cast<__m256i*>(to);
    for (int part = 0; part < 3; ++part) {
      const __m256i is_straight = _mm256_cmpeq_epi32(_mm256_and_si256(which, cell_of[part]), cell_of[part]);
      const __m256i is_above = _mm256_blendv_epi8(turned_above[part], straight_above[part], is_straight);
      const __m256i right = _mm256_blendv_epi8(turned_right[part], straight_right[part], is_straight);
      _mm256_storeu_si256(out + part, _mm256_add_epi32(_mm256_blendv_epi8(below, above, is_above), right));
    }
    to += 8;
  }
  return triangles_between(row, b, count, to);
}

#endif

constexpr GridPointKernels kPortable{"portable",      meet_portable,     straight_rays_portable,
                                     number_portable, vertices_portable, triangles_portable};

}  // namespace

const std::vector<GridPointKernels>& all_grid_point_kernels() {
#if defined(__x86_64__)
  static const auto kernels = variants(
      kPortable,
      GridPointKernels{"avx2", meet_avx2, straight_rays_avx2, number_avx2, vertices_avx2, triangles_avx2});
#else
  static const auto kernels = variants(kPortable);
#endif
  return kernels;
}

}  // namespace relievo
