// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "base/variants.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

constexpr int kShift = 13 + 5 - 3;  // 2^-13 of what is 32 times as large, to eighths

std::int16_t weighed(const std::int16_t* rgb, const std::int16_t* weights) {
  const std::int32_t sum = rgb[0] * weights[0] + rgb[1] * weights[1] + rgb[2] * weights[2];
  return static_cast<std::int16_t>(std::clamp(sum >> kShift, -32768, 32767));
}

void to_quads_from(int first, const std::int16_t* difference, const std::int16_t* sum, int width,
                   const QuadWeights& weights, std::int16_t* quads, std::int16_t* luma) {
  for (int x = first; x < width; ++x) {
    for (int c = 0; c < 3; ++c) quads[4 * x + c] = weighed(difference + 3 * x, weights.colour.data() + 3 * c);
    quads[4 * x + 3] = 0;
    luma[x] = weighed(sum + 3 * x, weights.luma.data());
  }
}

void to_quads_portable(const std::int16_t* difference, const std::int16_t* sum, int width,
                       const QuadWeights& weights, std::int16_t* quads, std::int16_t* luma) {
  to_quads_from(0, difference, sum, width, weights, quads, luma);
}

int crossings_from(int first, const std::int16_t* quads, int width, std::int16_t least_rise, Crossing* out) {
  int count = 0;
  for (int x = first; x + 2 < width; ++x) {
    unsigned channels = 0;
    for (int c = 0; c < 3; ++c) {
      const std::int16_t* d = quads + 4 * x + c;
      const int rise = std::clamp(d[8] - d[-4], -32768, 32767);
      const bool up = d[0] <= 0 && d[4] > 0 && rise >= least_rise;
      const bool down = d[0] > 0 && d[4] <= 0 && rise <= -least_rise;
      channels |= (up || down ? 1U : 0U) << c;
    }
    if (channels != 0) out[count++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(channels)};
  }
  return count;
}

int crossings_portable(const std::int16_t* quads, int width, std::int16_t least_rise, Crossing* out) {
  return crossings_from(1, quads, width, least_rise, out);
}

using Four = float __attribute__((vector_size(16)));
using FourInts = std::int32_t __attribute__((vector_size(16)));
using FourShorts = std::int16_t __attribute__((vector_size(8)));

[[gnu::always_inline]] inline void load(const std::int16_t* quad, Four& out) {
  FourShorts shorts;
  std::memcpy(&shorts, quad, sizeof shorts);
  out = __builtin_convertvector(shorts, Four);
}

/// Lanes of a crossing's channels.
alignas(16) constexpr std::array<std::array<std::int32_t, 4>, 8> kLanes = [] {
  std::array<std::array<std::int32_t, 4>, 8> out{};
  for (std::size_t channels = 0; channels < 8; ++channels)
    for (std::size_t c = 0; c < 3; ++c) out[channels][c] = channels >> c & 1 ? -1 : 0;
  return out;
}();

[[gnu::always_inline]] inline int gather_body(const std::int16_t* quads, const Crossing* crossings, int count,
                                              QuickPlace* out) {
  QuickPlace* next = out;
  for (int i = 0; i < count;) {
    const int first = crossings[i].x;
    // A crossing's variance goes with 1 / slope^2, which is the weight of the mean.
    Four weights{};
    Four sums{};
    for (; i < count && crossings[i].x - first < QuickKernels::kMerge_px; ++i) {
      Four here, behind;
      load(quads + 4 * crossings[i].x, here);
      load(quads + 4 * crossings[i].x + 4, behind);
      FourInts lanes;
      std::memcpy(&lanes, kLanes[crossings[i].channels].data(), sizeof lanes);
      const Four step = lanes ? behind - here : Four{};
      // step^2 (off - here / step), without the division.
      weights += step * step;
      sums += step * (step * static_cast<float>(crossings[i].x - first) - here);
    }
    const float weight = weights[0] + weights[1] + weights[2];
    *next++ = {static_cast<float>(first) + (sums[0] + sums[1] + sums[2]) / weight, std::sqrt(weight)};
  }
  return static_cast<int>(next - out);
}

int gather_portable(const std::int16_t* quads, const Crossing* crossings, int count, QuickPlace* out) {
  return gather_body(quads, crossings, count, out);
}

/// Sums, and whether each is clear; returns the signs.
unsigned side(const std::int16_t* quads, int first, int count, float doubt, std::array<float, 4>& sums,
              bool& clear) {
  std::array<int, 3> sum{};
  for (int x = first; x < first + count; ++x)
    for (std::size_t c = 0; c < 3; ++c) sum[c] += quads[4 * x + static_cast<int>(c)];
  float most = 0;
  float least = 1e9F;
  unsigned signs = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    sums[c] = static_cast<float>(sum[c]);
    most = std::max(most, std::fabs(sums[c]));
    least = std::min(least, std::fabs(sums[c]));
    signs |= (sum[c] > 0 ? 1U : 0U) << c;
  }
  sums[3] = 0;
  clear =
      least >= QuickKernels::kClear * (QuickKernels::kClearShare * most + static_cast<float>(count) * doubt);
  return signs;
}

void sides_portable(const std::int16_t* quads, const QuadSpans* spans, int count, float doubt,
                    QuadSides* out) {
  for (int i = 0; i < count; ++i) {
    const QuadSpans& s = spans[i];
    bool left = false;
    bool right = false;
    const unsigned left_signs = side(quads, s.left_first, s.left_count, doubt, out[i].left, left);
    const unsigned right_signs = side(quads, s.right_first, s.right_count, doubt, out[i].right, right);
    out[i].code = static_cast<std::uint8_t>(left_signs << 3 | right_signs);
    out[i].clear = left && right;
  }
}

[[gnu::always_inline]] inline void extremes_body(const std::int16_t* __restrict above,
                                                 const std::int16_t* __restrict here,
                                                 const std::int16_t* __restrict below, int width,
                                                 std::int16_t* __restrict brightest,
                                                 std::int16_t* __restrict darkest) {
  constexpr int kBlock = 64;
  constexpr int kAround = QuickKernels::kAround;
  constexpr int kRead = kBlock + 2 * kAround;
  std::array<std::int16_t, kRead> most, least;
  for (int begin = kAround; begin < width - kAround; begin += kBlock) {
    const int count = std::min(kBlock, width - kAround - begin);
    const int from = begin - kAround;
    const int read = count + 2 * kAround;
    for (int i = 0; i < read; ++i) {
      most[static_cast<std::size_t>(i)] =
          std::max(std::max(above[from + i], here[from + i]), below[from + i]);
      least[static_cast<std::size_t>(i)] =
          std::min(std::min(above[from + i], here[from + i]), below[from + i]);
    }
    for (int i = 0; i < count; ++i) {
      const std::int16_t* m = most.data() + i;
      const std::int16_t* l = least.data() + i;
      std::int16_t high = m[0];
      std::int16_t low = l[0];
      for (int k = 1; k <= 2 * kAround; ++k) {
        high = std::max(high, m[k]);
        low = std::min(low, l[k]);
      }
      brightest[begin + i] = high;
      darkest[begin + i] = low;
    }
  }
}

void extremes_portable(const std::int16_t* above, const std::int16_t* here, const std::int16_t* below,
                       int width, std::int16_t* brightest, std::int16_t* darkest) {
  extremes_body(above, here, below, width, brightest, darkest);
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

/// Four columns of interleaved RGB, each with nothing as its fourth. Reads four samples behind them.
RELIEVO_AVX2 __m256i four_columns(const std::int16_t* rgb) {
  const __m256i both =
      _mm256_insertf128_si256(_mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb))),
                              _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 6)), 1);
  const __m256i places = _mm256_setr_epi8(0, 1, 2, 3, 4, 5, -1, -1, 6, 7, 8, 9, 10, 11, -1, -1, 0, 1, 2, 3, 4,
                                          5, -1, -1, 6, 7, 8, 9, 10, 11, -1, -1);
  return _mm256_shuffle_epi8(both, places);
}

RELIEVO_AVX2 __m256i row_of(const std::int16_t* weights) {
  return _mm256_set1_epi64x(
      static_cast<long long>(static_cast<std::uint64_t>(static_cast<std::uint16_t>(weights[0])) |
                             static_cast<std::uint64_t>(static_cast<std::uint16_t>(weights[1])) << 16 |
                             static_cast<std::uint64_t>(static_cast<std::uint16_t>(weights[2])) << 32));
}

[[gnu::target("avx2")]] void to_quads_avx2(const std::int16_t* difference, const std::int16_t* sum, int width,
                                           const QuadWeights& weights, std::int16_t* quads,
                                           std::int16_t* luma) {
  const __m256i red = row_of(weights.colour.data());
  const __m256i green = row_of(weights.colour.data() + 3);
  const __m256i blue = row_of(weights.colour.data() + 6);
  const __m256i white = row_of(weights.luma.data());
  // Of each half: red and green of two columns, blue and luma of them -> two columns, and their luma.
  const __m256i order = _mm256_setr_epi8(0, 1, 4, 5, 8, 9, -1, -1, 2, 3, 6, 7, 10, 11, -1, -1, 0, 1, 4, 5, 8,
                                         9, -1, -1, 2, 3, 6, 7, 10, 11, -1, -1);
  int x = 0;
  for (; x + 6 <= width; x += 4) {
    const __m256i d = four_columns(difference + 3 * x);
    const __m256i s = four_columns(sum + 3 * x);
    const __m256i rg = _mm256_hadd_epi32(_mm256_madd_epi16(d, red), _mm256_madd_epi16(d, green));
    const __m256i bw = _mm256_hadd_epi32(_mm256_madd_epi16(d, blue), _mm256_madd_epi16(s, white));
    const __m256i packed = _mm256_packs_epi32(_mm256_srai_epi32(rg, kShift), _mm256_srai_epi32(bw, kShift));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(quads + 4 * x), _mm256_shuffle_epi8(packed, order));
    const auto first = static_cast<std::uint32_t>(_mm256_extract_epi32(packed, 3));
    const auto second = static_cast<std::uint32_t>(_mm256_extract_epi32(packed, 7));
    const std::uint64_t four = first | static_cast<std::uint64_t>(second) << 32;
    __builtin_memcpy(luma + x, &four, sizeof four);
  }
  to_quads_from(x, difference, sum, width, weights, quads, luma);
}

[[gnu::target("avx2")]] int crossings_avx2(const std::int16_t* quads, int width, std::int16_t least_rise,
                                           Crossing* out) {
  const auto at = [&](const std::int16_t* p) __attribute__((target("avx2"), always_inline)) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
  };
  const __m256i none = _mm256_setzero_si256();
  const __m256i least = _mm256_set1_epi16(static_cast<std::int16_t>(least_rise - 1));
  const __m256i most = _mm256_set1_epi16(static_cast<std::int16_t>(1 - least_rise));
  int count = 0;
  int x = 1;
  for (; x + 6 <= width; x += 4) {
    const __m256i here = at(quads + 4 * x);
    const __m256i next = at(quads + 4 * x + 4);
    const __m256i rise = _mm256_subs_epi16(at(quads + 4 * x + 8), at(quads + 4 * x - 4));
    const __m256i before_above = _mm256_cmpgt_epi16(here, none);
    const __m256i above = _mm256_cmpgt_epi16(next, none);
    const __m256i up =
        _mm256_and_si256(_mm256_andnot_si256(before_above, above), _mm256_cmpgt_epi16(rise, least));
    const __m256i down =
        _mm256_and_si256(_mm256_andnot_si256(above, before_above), _mm256_cmpgt_epi16(most, rise));
    auto mask = static_cast<unsigned>(_mm256_movemask_epi8(_mm256_or_si256(up, down)));
    while (mask != 0) {
      const auto column = static_cast<unsigned>(std::countr_zero(mask)) / 8;
      const unsigned bits = mask >> (8 * column);
      out[count++] = {static_cast<std::uint16_t>(static_cast<unsigned>(x) + column),
                      static_cast<std::uint16_t>((bits & 1) | (bits >> 1 & 2) | (bits >> 2 & 4))};
      mask &= ~(0xffU << (8 * column));
    }
  }
  return count + crossings_from(x, quads, width, least_rise, out + count);
}

[[gnu::target("avx2")]] int gather_avx2(const std::int16_t* quads, const Crossing* crossings, int count,
                                        QuickPlace* out) {
  return gather_body(quads, crossings, count, out);
}

/// As side(), of both sides at once, the left in the lower half.
RELIEVO_AVX2 void sides_of_one_avx2(const std::int16_t* quads, const QuadSpans& s, float doubt,
                                    QuadSides& out) {
  const __m256i lanes = _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3);
  const auto sum = [&](int first, int count) __attribute__((target("avx2"), always_inline)) {
    const __m256i all = _mm256_maskload_epi32(reinterpret_cast<const int*>(quads + 4 * first),
                                              _mm256_cmpgt_epi32(_mm256_set1_epi32(count), lanes));
    const __m256i wide = _mm256_add_epi32(_mm256_cvtepi16_epi32(_mm256_castsi256_si128(all)),
                                          _mm256_cvtepi16_epi32(_mm256_extracti128_si256(all, 1)));
    return _mm_add_epi32(_mm256_castsi256_si128(wide), _mm256_extracti128_si256(wide, 1));
  };
  const __m256i sums = _mm256_set_m128i(sum(s.right_first, s.right_count), sum(s.left_first, s.left_count));
  const __m256 values = _mm256_cvtepi32_ps(sums);
  const __m256 size = _mm256_andnot_ps(_mm256_set1_ps(-0.F), values);
  // The fourth takes another's place.
  const __m256 filled = _mm256_shuffle_ps(size, size, 0xa4);
  __m256 most = _mm256_max_ps(filled, _mm256_shuffle_ps(filled, filled, 0x4e));
  most = _mm256_max_ps(most, _mm256_shuffle_ps(most, most, 0xb1));
  const __m256 counts = _mm256_set_m128(_mm_set1_ps(static_cast<float>(s.right_count)),
                                        _mm_set1_ps(static_cast<float>(s.left_count)));
  const __m256 least =
      _mm256_mul_ps(_mm256_set1_ps(QuickKernels::kClear),
                    _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(QuickKernels::kClearShare), most),
                                  _mm256_mul_ps(counts, _mm256_set1_ps(doubt))));
  _mm256_storeu_ps(out.left.data(), values);  // and the right behind it
  const auto signs = static_cast<unsigned>(
      _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(sums, _mm256_setzero_si256()))));
  out.code = static_cast<std::uint8_t>((signs & 7) << 3 | (signs >> 4 & 7));
  out.clear = _mm256_movemask_ps(_mm256_cmp_ps(filled, least, _CMP_GE_OQ)) == 0xff;
}

[[gnu::target("avx2")]] void sides_avx2(const std::int16_t* quads, const QuadSpans* spans, int count,
                                        float doubt, QuadSides* out) {
  for (int i = 0; i < count; ++i) sides_of_one_avx2(quads, spans[i], doubt, out[i]);
}

[[gnu::target("avx2")]] void extremes_avx2(const std::int16_t* above, const std::int16_t* here,
                                           const std::int16_t* below, int width, std::int16_t* brightest,
                                           std::int16_t* darkest) {
  extremes_body(above, here, below, width, brightest, darkest);
}

#endif

}  // namespace

static_assert(offsetof(QuadSides, right) == 4 * sizeof(float));

const std::vector<QuickKernels>& all_quick_kernels() {
  const QuickKernels portable{"portable",      to_quads_portable, crossings_portable,
                              gather_portable, sides_portable,    extremes_portable};
#if defined(__x86_64__)
  static const auto kernels =
      variants(portable, {"avx2", to_quads_avx2, crossings_avx2, gather_avx2, sides_avx2, extremes_avx2});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const QuickKernels& quick_kernels() {
  return all_quick_kernels().back();
}

}  // namespace relievo
