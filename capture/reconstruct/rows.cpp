// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/rows.h"

#include <algorithm>
#include <cstring>

#include "capture/reconstruct/four.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

// The bodies are compiled once for every set of instructions: into each of the functions below that call
// them.
#define RELIEVO_BODY [[gnu::always_inline]] inline

RELIEVO_BODY void add_rows_body(const std::uint8_t* own, const std::uint8_t* above, const std::uint8_t* below,
                                int samples, std::uint8_t* __restrict out) {
  for (int i = 0; i < samples; ++i) {
    const auto mean = static_cast<std::uint8_t>((above[i] + below[i] + 1) >> 1);
    const auto sum = static_cast<std::uint8_t>(own[i] + mean);  // wraps where it is over 255
    out[i] = sum < mean ? std::uint8_t{255} : sum;
  }
}

/// |a - b| of every sample, with one more at both ends like its neighbour: to[-1] to to[samples].
RELIEVO_BODY void differences_body(const std::uint8_t* a, const std::uint8_t* b, int samples,
                                   std::uint8_t* __restrict to) {
  for (int i = 0; i < samples; ++i) {
    const std::uint8_t most = a[i] > b[i] ? a[i] : b[i];
    const std::uint8_t least = a[i] > b[i] ? b[i] : a[i];
    to[i] = static_cast<std::uint8_t>(most - least);
  }
  to[-1] = to[0];
  to[samples] = to[samples - 1];
}

/// Samples [first, samples) of weave_rows(); differences as differences_body() makes them.
RELIEVO_BODY void weave_body(const WovenRows& rows, const std::uint8_t* d_above, const std::uint8_t* d_below,
                             int first, int samples, std::uint8_t* out) {
  constexpr float kSlack = RowKernels::kAlike * RowKernels::kAlike;
  for (int i = first; i < samples; ++i) {
    const auto a = static_cast<float>(d_above[i - 1] + d_above[i] + d_above[i + 1]);
    const auto b = static_cast<float>(d_below[i - 1] + d_below[i] + d_below[i + 1]);
    const float fa = a * a + kSlack;
    const float fb = b * b + kSlack;
    const auto low = static_cast<float>(rows.below[i]);
    const float other = low + fb / (fa + fb) * (static_cast<float>(rows.above[i]) - low);
    const float sum = static_cast<float>(rows.own[i]) + other + 0.5F;
    out[i] = static_cast<std::uint8_t>(static_cast<int>(std::min(std::max(sum, 0.F), 255.F)));
  }
}

void weave_portable(const WovenRows& rows, int samples, std::uint8_t* differences, std::uint8_t* out) {
  std::uint8_t* above = differences + 1;
  std::uint8_t* below = above + samples + 2;
  differences_body(rows.own, rows.beyond_above, samples, above);
  differences_body(rows.own, rows.beyond_below, samples, below);
  weave_body(rows, above, below, 0, samples, out);
}

RELIEVO_BODY void combine_fields_body(const std::uint8_t* slide, const std::uint8_t* above,
                                      const std::uint8_t* below, int samples,
                                      std::int16_t* __restrict difference, std::int16_t* __restrict sum) {
  for (int i = 0; i < samples; ++i) {
    const auto lit = static_cast<std::int16_t>(2 * slide[i]);
    const auto unlit = static_cast<std::int16_t>(above[i] + below[i]);
    difference[i] = static_cast<std::int16_t>(lit - unlit);
    sum[i] = static_cast<std::int16_t>(lit + unlit);
  }
}

RELIEVO_BODY void low_pass_body(const std::int16_t* above, const std::int16_t* here,
                                const std::int16_t* below, int samples, std::int16_t* __restrict across,
                                std::int16_t* __restrict out) {
  for (int i = 0; i < samples; ++i) across[i] = static_cast<std::int16_t>(above[i] + 2 * here[i] + below[i]);
  for (int i = 3; i < samples - 3; ++i)
    out[i] = static_cast<std::int16_t>(across[i - 3] + 2 * across[i] + across[i + 3]);
  for (int i = 0; i < 3; ++i) {
    out[i] = static_cast<std::int16_t>(4 * across[i]);
    out[samples - 3 + i] = static_cast<std::int16_t>(4 * across[samples - 3 + i]);
  }
}

PairProducts products_of_block(const LinePair& pair, int block) {
  constexpr int kSamples = 3 * RowKernels::kPairBlock_px;
  PairProducts sums;
  for (int i = kSamples * block; i < kSamples * (block + 1); ++i) {
    const int here = pair.own[i] - pair.other[i];
    const int next = pair.next_own[i] - pair.next_other[i];
    sums.across += here * next;
    sums.here += here * here;
    sums.next += next * next;
  }
  return sums;
}

void pair_products_portable(const LinePair& pair, int blocks, PairProducts* out) {
  for (int block = 0; block < blocks; ++block) out[block] = products_of_block(pair, block);
}

RELIEVO_BODY void to_planes_body(const std::int16_t* __restrict difference,
                                 const std::int16_t* __restrict sum, int width, const PlaneWeights& weights,
                                 float* __restrict planes, float* __restrict white) {
  const std::array<float, 9> m = weights.colour;
  const std::array<float, 3> l = weights.luma;
  float* __restrict red = planes;
  float* __restrict green = planes + width;
  float* __restrict blue = planes + 2 * width;
  for (int x = 0; x < width; ++x) {
    const auto r = static_cast<float>(difference[3 * x]);
    const auto g = static_cast<float>(difference[3 * x + 1]);
    const auto b = static_cast<float>(difference[3 * x + 2]);
    red[x] = m[0] * r + m[1] * g + m[2] * b;
    green[x] = m[3] * r + m[4] * g + m[5] * b;
    blue[x] = m[6] * r + m[7] * g + m[8] * b;
  }
  for (int x = 0; x < width; ++x) {
    white[x] = l[0] * static_cast<float>(sum[3 * x]) + l[1] * static_cast<float>(sum[3 * x + 1]) +
               l[2] * static_cast<float>(sum[3 * x + 2]);
  }
}

RELIEVO_BODY void crossings_body(const float* __restrict planes, int width, float least_rise,
                                 std::uint8_t* __restrict flags) {
  const float* __restrict red = planes;
  const float* __restrict green = planes + width;
  const float* __restrict blue = planes + 2 * width;
  const auto crosses = [least_rise](const float* d, int x) {
    const float rise = d[x + 2] - d[x - 1];
    // A crossing's own step goes the way of the sign behind it.
    const int up = (d[x] <= 0) & (d[x + 1] > 0) & (rise >= least_rise);
    const int down = (d[x] > 0) & (d[x + 1] <= 0) & (rise <= -least_rise);
    return up | down;
  };
  for (int x = 0; x < width; ++x) flags[x] = 0;
  for (int x = 2; x < width - 2; ++x)
    flags[x] = static_cast<std::uint8_t>(crosses(red, x) | crosses(green, x) << 1 | crosses(blue, x) << 2);
}

Four four_at(const float* p) {
  Four out;
  std::memcpy(&out, p, sizeof out);
  return out;
}

/// Sums of the three channels over columns [first, last], the fourth 0.
Four sums(const float* planes, int width, int first, int last) {
  const float* red = planes;
  const float* green = planes + width;
  const float* blue = planes + 2 * width;
  Four r{}, g{}, b{};
  int x = first;
  for (; x + 4 <= width && x <= last; x += 4) {
    const int left = last - x + 1;
    const Four none{};
    const FourInts wanted = FourInts{0, 1, 2, 3} < left;
    r += wanted ? four_at(red + x) : none;
    g += wanted ? four_at(green + x) : none;
    b += wanted ? four_at(blue + x) : none;
  }
  for (; x <= last; ++x) {
    r[0] += red[x];
    g[0] += green[x];
    b[0] += blue[x];
  }
  const Four rg = __builtin_shufflevector(r, g, 0, 4, 1, 5) + __builtin_shufflevector(r, g, 2, 6, 3, 7);
  const Four b0 = b + __builtin_shufflevector(b, b, 2, 3, 0, 1);
  const Four b00 = __builtin_shufflevector(b0, Four{}, 0, 4, 1, 5);
  return __builtin_shufflevector(rg, b00, 0, 1, 4, 5) + __builtin_shufflevector(rg, b00, 2, 3, 6, 7);
}

std::array<float, 4> evidence(const float* planes, int width, int first, int last, float doubt) {
  const Four sum = sums(planes, width, first, last);
  const Four size = sum < 0 ? -sum : sum;
  const float strongest = std::max({size[0], size[1], size[2]});
  const auto count = static_cast<float>(last - first + 1);
  Four out = sum * (1.F / (RowKernels::kClearShare * strongest + count * doubt));
  const Four one{1, 1, 1, 1};
  out = out > one ? one : out;
  out = out < -one ? -one : out;
  return {out[0], out[1], out[2], 0};
}

void side_evidence_portable(const float* planes, int width, const SideWindows* windows, int count,
                            Sides* out) {
  for (int i = 0; i < count; ++i) {
    const SideWindows& w = windows[i];
    out[i].left = evidence(planes, width, w.left_first, w.left_last, w.left_doubt);
    out[i].right = evidence(planes, width, w.right_first, w.right_last, w.right_doubt);
  }
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

RELIEVO_AVX2 __m128i sixteen_at(const std::uint8_t* p) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
}

/// Sums of three samples in a row, of sixteen.
RELIEVO_AVX2 __m256i sums_of_three(const std::uint8_t* d) {
  return _mm256_add_epi16(
      _mm256_add_epi16(_mm256_cvtepu8_epi16(sixteen_at(d - 1)), _mm256_cvtepu8_epi16(sixteen_at(d))),
      _mm256_cvtepu8_epi16(sixteen_at(d + 1)));
}

RELIEVO_AVX2 __m256 floats_of(__m128i eight_bytes) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(eight_bytes));
}

/// Eight samples, as weave_body() makes them.
RELIEVO_AVX2 __m256i weave_eight(__m128i d_above, __m128i d_below, __m128i own, __m128i above,
                                 __m128i below) {
  const __m256 slack = _mm256_set1_ps(RowKernels::kAlike * RowKernels::kAlike);
  const __m256 a = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(d_above));
  const __m256 b = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(d_below));
  const __m256 fa = _mm256_add_ps(_mm256_mul_ps(a, a), slack);
  const __m256 fb = _mm256_add_ps(_mm256_mul_ps(b, b), slack);
  const __m256 low = floats_of(below);
  const __m256 share = _mm256_div_ps(fb, _mm256_add_ps(fa, fb));
  const __m256 other = _mm256_add_ps(low, _mm256_mul_ps(share, _mm256_sub_ps(floats_of(above), low)));
  const __m256 sum = _mm256_add_ps(_mm256_add_ps(floats_of(own), other), _mm256_set1_ps(0.5F));
  return _mm256_cvttps_epi32(_mm256_min_ps(_mm256_max_ps(sum, _mm256_setzero_ps()), _mm256_set1_ps(255.F)));
}

[[gnu::target("avx2")]] void weave_avx2(const WovenRows& rows, int samples, std::uint8_t* differences,
                                        std::uint8_t* out) {
  std::uint8_t* above = differences + 1;
  std::uint8_t* below = above + samples + 2;
  differences_body(rows.own, rows.beyond_above, samples, above);
  differences_body(rows.own, rows.beyond_below, samples, below);
  int i = 0;
  for (; i + 16 <= samples; i += 16) {
    const __m256i a = sums_of_three(above + i);
    const __m256i b = sums_of_three(below + i);
    const __m128i own = sixteen_at(rows.own + i);
    const __m128i over = sixteen_at(rows.above + i);
    const __m128i under = sixteen_at(rows.below + i);
    const __m256i first = weave_eight(_mm256_castsi256_si128(a), _mm256_castsi256_si128(b), own, over, under);
    const __m256i second =
        weave_eight(_mm256_extracti128_si256(a, 1), _mm256_extracti128_si256(b, 1), _mm_srli_si128(own, 8),
                    _mm_srli_si128(over, 8), _mm_srli_si128(under, 8));
    const __m256i words = _mm256_permute4x64_epi64(_mm256_packus_epi32(first, second), 0xd8);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + i),
                     _mm_packus_epi16(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1)));
  }
  weave_body(rows, above, below, i, samples, out);
}

/// Both sides at once, the left in the lower half of each register.
[[gnu::target("avx2"), gnu::always_inline]] inline void one_side_evidence_avx2(const float* planes, int width,
                                                                               const SideWindows& w,
                                                                               Sides& out) {
  const int left_count = w.left_last - w.left_first + 1;
  const int right_count = w.right_last - w.right_first + 1;
  if (left_count > 4 || right_count > 4 || w.left_first + 4 > width || w.right_first + 4 > width) {
    side_evidence_portable(planes, width, &w, 1, &out);
    return;
  }
  const __m256i count = _mm256_set_m128i(_mm_set1_epi32(right_count), _mm_set1_epi32(left_count));
  const __m256 wanted =
      _mm256_castsi256_ps(_mm256_cmpgt_epi32(count, _mm256_setr_epi32(0, 1, 2, 3, 0, 1, 2, 3)));
  const auto channel = [&](int c) __attribute__((target("avx2"), always_inline)) {
    const float* row = planes + c * width;
    return _mm256_and_ps(wanted,
                         _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(row + w.left_first)),
                                              _mm_loadu_ps(row + w.right_first), 1));
  };
  const __m256 red = channel(0);
  const __m256 green = channel(1);
  const __m256 blue = channel(2);
  // Lanes 0 and 2, and 1 and 3, are added first, as in sums().
  const __m256 rg = _mm256_add_ps(_mm256_unpacklo_ps(red, green), _mm256_unpackhi_ps(red, green));
  const __m256 b0 = _mm256_add_ps(_mm256_unpacklo_ps(blue, _mm256_setzero_ps()),
                                  _mm256_unpackhi_ps(blue, _mm256_setzero_ps()));
  const __m256 sum = _mm256_add_ps(_mm256_shuffle_ps(rg, b0, 0x44), _mm256_shuffle_ps(rg, b0, 0xee));
  const __m256 size = _mm256_andnot_ps(_mm256_set1_ps(-0.F), sum);
  __m256 strongest = _mm256_max_ps(size, _mm256_shuffle_ps(size, size, 0x4e));
  strongest = _mm256_max_ps(strongest, _mm256_shuffle_ps(strongest, strongest, 0xb1));
  const __m256 doubt = _mm256_set_m128(_mm_set1_ps(w.right_doubt), _mm_set1_ps(w.left_doubt));
  const __m256 unit = _mm256_div_ps(
      _mm256_set1_ps(1), _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(RowKernels::kClearShare), strongest),
                                       _mm256_mul_ps(_mm256_cvtepi32_ps(count), doubt)));
  const __m256 evidence =
      _mm256_max_ps(_mm256_set1_ps(-1), _mm256_min_ps(_mm256_set1_ps(1), _mm256_mul_ps(sum, unit)));
  _mm256_storeu_ps(out.left.data(), evidence);  // and the right behind it
}

/// Sixteen samples of own less other.
RELIEVO_AVX2 __m256i less(const std::uint8_t* own, const std::uint8_t* other) {
  return _mm256_sub_epi16(_mm256_cvtepu8_epi16(sixteen_at(own)), _mm256_cvtepu8_epi16(sixteen_at(other)));
}

/// Of two blocks, which are three times sixteen samples: four sums of products of each.
RELIEVO_AVX2 __m256i sums_of_two(const __m256i* a, const __m256i* b) {
  const __m256i first = _mm256_madd_epi16(a[0], b[0]);
  const __m256i middle = _mm256_madd_epi16(a[1], b[1]);  // half of it is the first block's
  const __m256i last = _mm256_madd_epi16(a[2], b[2]);
  return _mm256_add_epi32(middle, _mm256_add_epi32(_mm256_permute2x128_si256(first, last, 0x20),
                                                   _mm256_permute2x128_si256(first, last, 0x31)));
}

[[gnu::target("avx2")]] void pair_products_avx2(const LinePair& pair, int blocks, PairProducts* out) {
  int block = 0;
  for (; block + 1 < blocks; block += 2) {
    const std::ptrdiff_t first = std::ptrdiff_t{3 * RowKernels::kPairBlock_px} * block;
    __m256i here[3], next[3];
    for (int i = 0; i < 3; ++i) {
      const std::ptrdiff_t at = first + 16 * i;
      here[i] = less(pair.own + at, pair.other + at);
      next[i] = less(pair.next_own + at, pair.next_other + at);
    }
    const __m256i squares = sums_of_two(next, next);
    const __m256i sums =
        _mm256_hadd_epi32(_mm256_hadd_epi32(sums_of_two(here, next), sums_of_two(here, here)),
                          _mm256_hadd_epi32(squares, squares));
    alignas(32) std::array<std::int32_t, 8> of_both;
    _mm256_store_si256(reinterpret_cast<__m256i*>(of_both.data()), sums);
    out[block] = {of_both[0], of_both[1], of_both[2]};
    out[block + 1] = {of_both[4], of_both[5], of_both[6]};
  }
  if (block < blocks) out[block] = products_of_block(pair, block);
}

[[gnu::target("avx2")]] void side_evidence_avx2(const float* planes, int width, const SideWindows* windows,
                                                int count, Sides* out) {
  for (int i = 0; i < count; ++i) one_side_evidence_avx2(planes, width, windows[i], out[i]);
}

#endif

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes, weave, pair_products, side_evidence)                      \
  struct set {                                                                                     \
    attributes static void add_rows(const std::uint8_t* own, const std::uint8_t* above,            \
                                    const std::uint8_t* below, int samples, std::uint8_t* out) {   \
      add_rows_body(own, above, below, samples, out);                                              \
    }                                                                                              \
    attributes static void combine_fields(const std::uint8_t* slide, const std::uint8_t* above,    \
                                          const std::uint8_t* below, int samples, FieldRows out) { \
      combine_fields_body(slide, above, below, samples, out.difference, out.sum);                  \
    }                                                                                              \
    attributes static void low_pass(const std::int16_t* above, const std::int16_t* here,           \
                                    const std::int16_t* below, int samples, std::int16_t* across,  \
                                    std::int16_t* out) {                                           \
      low_pass_body(above, here, below, samples, across, out);                                     \
    }                                                                                              \
    attributes static void to_planes(FieldRows rows, int width, const PlaneWeights& weights,       \
                                     PlaneRows out) {                                              \
      to_planes_body(rows.difference, rows.sum, width, weights, out.planes, out.white);            \
    }                                                                                              \
    attributes static void crossings(const float* planes, int width, float least_rise,             \
                                     std::uint8_t* flags) {                                        \
      crossings_body(planes, width, least_rise, flags);                                            \
    }                                                                                              \
    static RowKernels table(const char* name) {                                                    \
      return {name,          add_rows,  weave,     combine_fields, low_pass,                       \
              pair_products, to_planes, crossings, side_evidence};                                 \
    }                                                                                              \
  }

RELIEVO_KERNELS(Portable, , weave_portable, pair_products_portable, side_evidence_portable);
#if defined(__x86_64__)
// Without fused multiply-add, whose results differ in the last bit from the reference's.
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]], weave_avx2, pair_products_avx2, side_evidence_avx2);
#endif

}  // namespace

static_assert(sizeof(Sides) == 8 * sizeof(float));

const std::vector<RowKernels>& all_row_kernels() {
  static const std::vector<RowKernels> kernels = [] {
    std::vector<RowKernels> out{Portable::table("portable")};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back(Avx2::table("avx2"));
#endif
    return out;
  }();
  return kernels;
}

const RowKernels& row_kernels() {
  return all_row_kernels().back();
}

}  // namespace relievo
