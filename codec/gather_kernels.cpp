// SPDX-License-Identifier: Apache-2.0
#include "codec/gather_kernels.h"

#include <algorithm>
#include <limits>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/variants.h"

namespace relievo {
namespace {

std::int32_t floor_of(float x) {
  const auto whole = static_cast<std::int32_t>(x);
  return whole - (x < static_cast<float>(whole) ? 1 : 0);
}

/// Vertices [begin, end).
Gathered gather(const GatherVertices& job, std::size_t begin, std::size_t end) {
  const auto boundaries = static_cast<unsigned>(job.grid.boundaries);
  const auto lines = static_cast<unsigned>(job.lines);
  const auto stride = static_cast<std::size_t>(job.grid.stride());
  std::int32_t* const columns = job.grid.columns.data() + StripeGrid::kMargin;
  for (std::size_t i = begin; i < end; ++i) {
    const GridPoint& p = job.points[i];
    if (i > 0) job.right[i - 1] = place_key(p) - place_key(job.points[i - 1]) == kRightKey;
    if (p.boundary >= boundaries || p.line >= lines || !(p.column_px > -0.5F && p.column_px < job.width_px))
      return Gathered::kOutside;
    std::int32_t& column = columns[p.line * stride + p.boundary];
    if (column != StripeGrid::kAbsent) return Gathered::kTwice;
    column = floor_of(p.column_px * job.steps + 0.5F);
  }
  return Gathered::kAll;
}

void end_right(const GatherVertices& job) {
  if (!job.points.empty()) job.right[job.points.size() - 1] = 0;
}

Gathered vertices_portable(const GatherVertices& job) {
  const Gathered done = gather(job, 0, job.points.size());
  end_right(job);
  return done;
}

constexpr std::uint32_t kExponent = 0x7f800000U;  // of a number; all of it where the number is not finite

Reach reach_portable(std::span<const Vec3f> positions, float farthest_m) {
  bool finite = true, near = true;
  for (const Vec3f& p : positions) {
    for (const float x : p) finite &= (std::bit_cast<std::uint32_t>(x) & kExponent) != kExponent;
    near &= p[2] < farthest_m;
  }
  return !finite ? Reach::kNotFinite : near ? Reach::kNear : Reach::kFar;
}

/// Two numbers of vertices side by side, as they lie in memory.
std::uint64_t pair_of(std::uint32_t first, std::uint32_t second) {
  return static_cast<std::uint64_t>(second) << 32 | first;
}
constexpr std::uint64_t kNextPair = (std::uint64_t{1} << 32) + 1;

/// 0 or 1, without a branch, which on the diagonal is hard to foresee.
unsigned is_not_0(std::uint64_t x) {
  return static_cast<unsigned>((x | (0 - x)) >> 63);
}

std::size_t fill_run_portable(const FilledRun& run) {
  static_assert(sizeof(Triangle) == 3 * sizeof(std::uint32_t) && std::endian::native == std::endian::little);
  std::uint32_t upper = run.upper, lower = run.lower;
  std::size_t cells = 0;
  // Both rings of four corners as two triangles, four numbers in 64 bits each: a b c | c d a.
  std::uint64_t straight0 = pair_of(upper, lower), both1 = pair_of(lower, lower) + kNextPair;
  std::uint64_t straight2 = pair_of(upper + 1, upper);
  for (; 2 * cells + 2 <= run.triangles.size(); ++cells) {
    if ((run.right[upper] & run.right[lower]) == 0 || run.cell[cells] != 0) break;
    std::uint64_t have[3];
    std::memcpy(have, run.triangles.data() + 2 * cells, sizeof have);
    const std::uint64_t turned1 = pair_of(upper, upper) + kNextPair;
    const std::uint64_t not_straight = (have[0] ^ straight0) | (have[1] ^ both1) | (have[2] ^ straight2);
    const std::uint64_t not_turned =
        (have[0] ^ pair_of(lower, lower + 1)) | (have[1] ^ turned1) | (have[2] ^ straight0);
    if ((is_not_0(not_straight) & is_not_0(not_turned)) != 0) break;
    run.cell[cells] = static_cast<std::uint8_t>(
        grid_cell::kStraight ^ (is_not_0(not_straight) * (grid_cell::kStraight ^ grid_cell::kTurned)));
    straight0 += kNextPair;
    both1 += kNextPair;
    straight2 += kNextPair;
    ++upper;
    ++lower;
  }
  return cells;
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

/// Asks for what is read some rounds later, up to two cache lines a round: surfaces are larger than the near
/// caches. It may lie behind their end.
RELIEVO_AVX2 void fetch_ahead(const void* from) {
  constexpr std::ptrdiff_t kAhead = 2048, kCacheLine = 64;
  const char* ahead = static_cast<const char*>(from) + kAhead;
  _mm_prefetch(ahead, _MM_HINT_T0);
  _mm_prefetch(ahead + kCacheLine, _MM_HINT_T0);
}

struct EightPoints {
  __m256i keys;
  __m256 columns_px;
};

RELIEVO_AVX2 EightPoints load_points(const GridPoint* from) {
  static_assert(sizeof(GridPoint) == 16 && offsetof(GridPoint, column_px) == 4);
  const auto pair = [from](std::size_t i) __attribute__((target("avx2"), always_inline)) {
    const __m128i first = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i));
    const __m128i second = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i + 4));
    return _mm256_inserti128_si256(_mm256_castsi128_si256(first), second, 1);
  };
  const __m256i even = _mm256_unpacklo_epi32(pair(0), pair(1)), odd = _mm256_unpacklo_epi32(pair(2), pair(3));
  return {_mm256_unpacklo_epi64(even, odd), _mm256_castsi256_ps(_mm256_unpackhi_epi64(even, odd))};
}

RELIEVO_AVX2 unsigned mask_of(__m256i lanes) {
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(lanes)));
}

/// Vertices that lie side by side, as many as eight of them begin with: their columns are written at once.
[[gnu::target("avx2")]] Gathered vertices_avx2(const GatherVertices& job) {
  const auto boundaries = static_cast<std::uint32_t>(job.grid.boundaries);
  const auto lines = static_cast<std::uint32_t>(job.lines);
  const auto stride = static_cast<std::size_t>(job.grid.stride());
  std::int32_t* const columns = job.grid.columns.data() + StripeGrid::kMargin;
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i absent = _mm256_set1_epi32(StripeGrid::kAbsent);
  const std::size_t count = job.points.size();
  std::size_t i = 0;
  while (i + 8 <= count) {
    const GridPoint& first = job.points[i];
    const EightPoints points = load_points(&first);
    const std::uint32_t key = place_key(first);
    fetch_ahead(&first);
    const __m256i expected = _mm256_add_epi32(_mm256_set1_epi32(static_cast<std::int32_t>(key)), lane);
    const unsigned run = mask_of(_mm256_cmpeq_epi32(points.keys, expected));
    // By itself, so that the next eight do not wait for these to be counted.
    const unsigned n = run == 0xffU ? 8U : static_cast<unsigned>(std::countr_one(run));
    const std::size_t at = first.line * stride + first.boundary;
    if (first.line >= lines || first.boundary + n > boundaries) return gather(job, i, count);
    const __m256i before = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(columns + at));
    const __m256 inside =
        _mm256_and_ps(_mm256_cmp_ps(points.columns_px, _mm256_set1_ps(-0.5F), _CMP_GT_OQ),
                      _mm256_cmp_ps(points.columns_px, _mm256_set1_ps(job.width_px), _CMP_LT_OQ));
    const unsigned good =
        mask_of(_mm256_and_si256(_mm256_cmpeq_epi32(before, absent), _mm256_castps_si256(inside)));
    if (static_cast<unsigned>(std::countr_one(good)) < n) return gather(job, i, count);
    const __m256 scaled =
        _mm256_add_ps(_mm256_mul_ps(points.columns_px, _mm256_set1_ps(job.steps)), _mm256_set1_ps(0.5F));
    const __m256i mine = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<std::int32_t>(n)), lane);
    const __m256i column = _mm256_blendv_epi8(before, _mm256_cvttps_epi32(_mm256_floor_ps(scaled)), mine);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(columns + at), column);
    if (i > 0) job.right[i - 1] = key - place_key(job.points[i - 1]) == kRightKey;
    std::memset(job.right + i, 1, 8);  // those behind the run are written again
    i += n;
  }
  const Gathered done = gather(job, i, count);
  end_right(job);
  return done;
}

[[gnu::target("avx2")]] Reach reach_avx2(std::span<const Vec3f> positions, float farthest_m) {
  constexpr float kAny = std::numeric_limits<float>::infinity();
  const float f = farthest_m;
  // Eight positions: of x and y nothing is asked but that they are finite.
  const __m256 limits[3] = {_mm256_setr_ps(kAny, kAny, f, kAny, kAny, f, kAny, kAny),
                            _mm256_setr_ps(f, kAny, kAny, f, kAny, kAny, f, kAny),
                            _mm256_setr_ps(kAny, f, kAny, kAny, f, kAny, kAny, f)};
  const __m256i exponent = _mm256_set1_epi32(static_cast<std::int32_t>(kExponent));
  __m256 far = _mm256_setzero_ps();
  __m256i endless = _mm256_setzero_si256();
  std::size_t i = 0;
  for (; i + 8 <= positions.size(); i += 8) {
    const float* from = positions[i].data();
    fetch_ahead(from);
    for (int part = 0; part < 3; ++part) {
      const __m256 numbers = _mm256_loadu_ps(from + 8 * part);
      far = _mm256_or_ps(far, _mm256_cmp_ps(numbers, limits[part], _CMP_NLT_UQ));
      const __m256i bits = _mm256_and_si256(_mm256_castps_si256(numbers), exponent);
      endless = _mm256_or_si256(endless, _mm256_cmpeq_epi32(bits, exponent));
    }
  }
  const Reach rest = reach_portable(positions.subspan(i), farthest_m);
  if (mask_of(endless) != 0 || rest == Reach::kNotFinite) return Reach::kNotFinite;
  return _mm256_movemask_ps(far) != 0 ? Reach::kFar : rest;
}

constexpr std::uint32_t kFirstOfSix = 0x41041U;  // of four cells' six bits each

/// From every sixth bit to every eighth.
std::uint32_t spread(std::uint32_t firsts_of_six) {
  return firsts_of_six * 0x55U & 0x01010101U;
}
/// Of cells' six bits, whether all are there.
std::uint32_t whole_cells(std::uint32_t bits) {
  bits &= bits >> 1;  // two
  const std::uint32_t four = bits & bits >> 2;
  return spread(four & bits >> 4 & kFirstOfSix);
}

RELIEVO_AVX2 std::uint32_t bits_of(const __m256i* lanes) {
  return mask_of(lanes[0]) | mask_of(lanes[1]) << 8 | mask_of(lanes[2]) << 16;
}

std::uint32_t load4(const std::uint8_t* from) {
  std::uint32_t four;
  std::memcpy(&four, from, sizeof four);
  return four;
}

/// Four cells at a time.
[[gnu::target("avx2")]] std::size_t fill_run_avx2(const FilledRun& run) {
  constexpr std::uint32_t kFourOnes = 0x01010101U;
  const __m256i u = _mm256_set1_epi32(static_cast<std::int32_t>(run.upper));
  const __m256i l = _mm256_set1_epi32(static_cast<std::int32_t>(run.lower));
  // The corners of two triangles a cell: straight u l l+1 | l+1 u+1 u, turned l l+1 u+1 | u+1 u l.
  const __m256i straight[3] = {
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b01110001), _mm256_setr_epi32(0, 0, 1, 1, 1, 0, 1, 1)),
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b00011100), _mm256_setr_epi32(2, 2, 2, 1, 2, 2, 3, 3)),
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b11000111), _mm256_setr_epi32(3, 2, 3, 3, 4, 4, 4, 3))};
  const __m256i turned[3] = {
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b00011100), _mm256_setr_epi32(0, 1, 1, 1, 0, 0, 1, 2)),
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b11000111), _mm256_setr_epi32(2, 2, 1, 1, 2, 3, 3, 3)),
      _mm256_add_epi32(_mm256_blend_epi32(l, u, 0b01110001), _mm256_setr_epi32(2, 2, 3, 4, 4, 4, 3, 3))};
  const std::uint8_t* const right_of_upper = run.right + run.upper;
  const std::uint8_t* const right_of_lower = run.right + run.lower;
  __m256i before = _mm256_setzero_si256();  // cells
  std::size_t cells = 0;
  for (const std::size_t most = run.triangles.size() / 2; cells + 4 <= most; cells += 4) {
    const auto* from = reinterpret_cast<const __m256i*>(run.triangles.data() + 2 * cells);
    fetch_ahead(from);
    __m256i as_straight[3], as_turned[3], as_one = _mm256_set1_epi32(-1);
    for (int part = 0; part < 3; ++part) {
      const __m256i have = _mm256_sub_epi32(_mm256_loadu_si256(from + part), before);
      as_straight[part] = _mm256_cmpeq_epi32(have, straight[part]);
      as_turned[part] = _mm256_cmpeq_epi32(have, turned[part]);
      as_one = _mm256_and_si256(as_one, _mm256_or_si256(as_straight[part], as_turned[part]));
    }
    before = _mm256_add_epi32(before, _mm256_set1_epi32(4));
    const std::uint32_t bits = bits_of(as_straight), firsts = bits & kFirstOfSix;
    const std::uint32_t taken = load4(run.cell + cells);
    const std::uint32_t open = load4(right_of_upper + cells) & load4(right_of_lower + cells) &
                               ~((taken + 15 * kFourOnes) >> 4) & kFourOnes;
    static_assert(grid_cell::kStraight == 2 * grid_cell::kTurned);
    const std::uint32_t kinds = grid_cell::kTurned * (kFourOnes + spread(firsts));
    // Most likely all numbers are as one of the two has them, and those of a cell as the same one.
    if (open != kFourOnes || bits != firsts * 63 || mask_of(as_one) != 0xffU) {
      const std::uint32_t fills = (whole_cells(bits) | whole_cells(bits_of(as_turned))) & open;
      const int count = std::countr_zero(~fills & kFourOnes) / 8;
      const auto those = static_cast<std::uint32_t>((std::uint64_t{1} << 8 * count) - 1);
      const std::uint32_t all = taken | (kinds & those);
      std::memcpy(run.cell + cells, &all, sizeof all);
      return cells + static_cast<std::size_t>(count);
    }
    std::memcpy(run.cell + cells, &kinds, sizeof kinds);
  }
  const auto done = static_cast<std::uint32_t>(cells);
  return cells + fill_run_portable({run.triangles.subspan(2 * cells), run.right, run.upper + done,
                                    run.lower + done, run.cell + cells});
}

#endif

constexpr GatherKernels kPortable{"portable", vertices_portable, reach_portable, fill_run_portable};

}  // namespace

const std::vector<GatherKernels>& all_gather_kernels() {
#if defined(__x86_64__)
  static const auto kernels =
      variants(kPortable, GatherKernels{"avx2", vertices_avx2, reach_avx2, fill_run_avx2});
#else
  static const auto kernels = variants(kPortable);
#endif
  return kernels;
}

const GatherKernels& gather_kernels() {
  return all_gather_kernels().back();
}

}  // namespace relievo
