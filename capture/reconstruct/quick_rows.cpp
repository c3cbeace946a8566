// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#include "base/variants.h"
#include "capture/reconstruct/crossing.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

// A low-passed row is 32 times as large as grey levels, weights are 2^13: their product over 2^15 is eighths.
constexpr int kShift = 13 + 5 - 3;

constexpr std::int16_t share_of(float share) {
  return static_cast<std::int16_t>(share * 32768 + 0.5F);
}
constexpr std::int16_t kClearOfMost = share_of(QuickKernels::kClear * QuickKernels::kClearShare);
constexpr std::int16_t kClearOfDoubt = share_of(QuickKernels::kClear);

/// Product over 2^15, rounded, as _mm256_mulhrs_epi16 has it.
int scaled(int a, int b) {
  return (a * b + (1 << (kShift - 1))) >> kShift;
}
int saturated(int v) {
  return std::clamp(v, -32768, 32767);
}

std::int16_t weighed(const std::int16_t* rgb, const std::int16_t* weights) {
  const int two = saturated(saturated(scaled(rgb[0], weights[0])) + scaled(rgb[1], weights[1]));
  return static_cast<std::int16_t>(saturated(two + scaled(rgb[2], weights[2])));
}

void to_planes_from(int first, const std::int16_t* difference, const std::int16_t* sum, int width,
                    const QuickWeights& weights, std::int16_t* planes, int stride, std::int16_t* luma) {
  for (int x = first; x < width; ++x) {
    for (int c = 0; c < 3; ++c)
      planes[c * stride + x] = weighed(difference + 3 * x, weights.colour.data() + 3 * c);
    luma[x] = weighed(sum + 3 * x, weights.luma.data());
  }
}

void to_planes_portable(const std::int16_t* difference, const std::int16_t* sum, int width,
                        const QuickWeights& weights, std::int16_t* planes, int stride, std::int16_t* luma) {
  to_planes_from(0, difference, sum, width, weights, planes, stride, luma);
}

void codes_from(int first, const QuickRow& row, int width, std::int16_t doubt, std::uint8_t* out) {
  const int least_of_doubt = scaled(doubt, kClearOfDoubt);
  for (int x = first; x < width; ++x) {
    const auto size = [](std::int16_t v) { return std::min(std::abs(int{v}), 32767); };
    const auto [least, most] = std::minmax({size(row.red[x]), size(row.green[x]), size(row.blue[x])});
    const unsigned signs =
        (row.red[x] > 0 ? 1U : 0U) | (row.green[x] > 0 ? 2U : 0U) | (row.blue[x] > 0 ? 4U : 0U);
    const bool clear = least >= scaled(most, kClearOfMost) + least_of_doubt;
    out[x] = static_cast<std::uint8_t>(signs | (clear ? QuickKernels::kIsClear : 0U));
  }
}

void codes_portable(const QuickRow& row, int width, std::int16_t doubt, std::uint8_t* out) {
  codes_from(0, row, width, doubt, out);
}

int crossings_from(int first, const QuickRow& row, int width, std::int16_t least_rise, Crossing* out) {
  int count = 0;
  for (int x = first; x + 2 < width; ++x) {
    unsigned channels = 0;
    for (const std::int16_t* d : {row.blue + x, row.green + x, row.red + x}) {
      const int rise = saturated(d[2] - d[-1]);
      const bool up = d[0] <= 0 && d[1] > 0 && rise >= least_rise;
      const bool down = d[0] > 0 && d[1] <= 0 && rise <= -least_rise;
      channels = channels << 1 | (up || down ? 1U : 0U);
    }
    if (channels != 0) out[count++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(channels)};
  }
  return count;
}

int crossings_portable(const QuickRow& row, int width, std::int16_t least_rise, Crossing* out) {
  return crossings_from(1, row, width, least_rise, out);
}

/// Of crossing `i`: the sum of its channels' squared slopes to `slope`, and of these times how far behind its
/// column they cross to `column_px`.
void weigh_crossing(const QuickRow& row, const Crossing& crossing, QuickPlace& out) {
  float weight = 0;
  float sum = 0;
  unsigned bits = crossing.channels;
  for (const std::int16_t* plane : {row.red, row.green, row.blue}) {
    const bool crosses = bits & 1;
    bits >>= 1;
    if (!crosses) continue;
    const auto at = [&](int off) { return static_cast<float>(plane[crossing.x + off]); };
    const float step = at(1) - at(0);
    float behind;
    crossing_of(at(-1), at(0), at(1), at(2), behind);
    weight += step * step;
    sum += step * step * behind;
  }
  out = {sum, weight};
}

/// `out` holds what weigh_crossing() makes of each.
[[gnu::always_inline]] inline int merge_body(const Crossing* crossings, int count, QuickPlace* out) {
  int places = 0;
  // A crossing's variance goes with 1 / slope^2, which is the weight of the mean.
  for (int i = 0; i < count;) {
    const int first = crossings[i].x;
    QuickPlace all = out[i++];
    for (; i < count && crossings[i].x - first < QuickKernels::kMerge_px; ++i) {
      all.column_px += out[i].column_px + out[i].slope * static_cast<float>(crossings[i].x - first);
      all.slope += out[i].slope;
    }
    out[places++] = {static_cast<float>(first) + all.column_px / all.slope, std::sqrt(all.slope)};
  }
  return places;
}

int gather_portable(const QuickRow& row, const Crossing* crossings, int count, QuickPlace* out) {
  for (int i = 0; i < count; ++i) weigh_crossing(row, crossings[i], out[i]);
  return merge_body(crossings, count, out);
}

void sides_portable(const QuickRow& row, const QuickSpans& spans, QuickSides& out) {
  const auto sums = [&](int first, int count, std::array<float, 4>& to) {
    const std::array planes{row.red, row.green, row.blue};
    for (std::size_t c = 0; c < 3; ++c) {
      int sum = 0;
      for (int x = first; x < first + count; ++x) sum += planes[c][x];
      to[c] = static_cast<float>(sum);
    }
    to[3] = 0;
  };
  sums(spans.left_first, spans.left_count, out.left);
  sums(spans.right_first, spans.right_count, out.right);
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

RELIEVO_AVX2 __m256i load(const std::int16_t* p) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
}
RELIEVO_AVX2 void store(std::int16_t* p, __m256i v) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), v);
}

struct SixteenColumns {
  __m256i red, green, blue;
};

/// Of each half, value i of a channel from place (first + 3 i) mod 8.
template <int first>
RELIEVO_AVX2 __m256i in_order(__m256i values) {
  const auto pair = [](int i) {
    const int at = 2 * ((first + 3 * i) % 8);
    return static_cast<short>((at + 1) << 8 | at);
  };
  const __m128i half = _mm_setr_epi16(pair(0), pair(1), pair(2), pair(3), pair(4), pair(5), pair(6), pair(7));
  return _mm256_shuffle_epi8(values, _mm256_set_m128i(half, half));
}

/// Sixteen columns of interleaved RGB, plane by plane.
RELIEVO_AVX2 SixteenColumns sixteen_columns(const std::int16_t* rgb) {
  // Eight columns in each half of three registers: no channel has its values twice in the same place of them.
  const auto halves = [&](int i) __attribute__((target("avx2"), always_inline)) {
    return _mm256_set_m128i(_mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 24 + 8 * i)),
                            _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 8 * i)));
  };
  const __m256i a = halves(0);
  const __m256i b = halves(1);
  const __m256i c = halves(2);
  // Of values 0 to 7: those at 0, 3, 6, at 1, 4, 7 and at 2, 5.
  constexpr int kSecond = 0b10010010, kThird = 0b00100100;
  const __m256i red = _mm256_blend_epi16(_mm256_blend_epi16(a, b, kSecond), c, kThird);
  const __m256i green = _mm256_blend_epi16(_mm256_blend_epi16(c, a, kSecond), b, kThird);
  const __m256i blue = _mm256_blend_epi16(_mm256_blend_epi16(b, c, kSecond), a, kThird);
  return {in_order<0>(red), in_order<1>(green), in_order<2>(blue)};
}

RELIEVO_AVX2 __m256i weighed_avx2(const SixteenColumns& v, const std::int16_t* weights) {
  const __m256i r = _mm256_mulhrs_epi16(v.red, _mm256_set1_epi16(weights[0]));
  const __m256i g = _mm256_mulhrs_epi16(v.green, _mm256_set1_epi16(weights[1]));
  const __m256i b = _mm256_mulhrs_epi16(v.blue, _mm256_set1_epi16(weights[2]));
  return _mm256_adds_epi16(_mm256_adds_epi16(r, g), b);
}

[[gnu::target("avx2")]] void to_planes_avx2(const std::int16_t* difference, const std::int16_t* sum,
                                            int width, const QuickWeights& weights, std::int16_t* planes,
                                            int stride, std::int16_t* luma) {
  int x = 0;
  for (; x + 16 <= width; x += 16) {
    const SixteenColumns d = sixteen_columns(difference + 3 * x);
    store(planes + x, weighed_avx2(d, weights.colour.data()));
    store(planes + stride + x, weighed_avx2(d, weights.colour.data() + 3));
    store(planes + 2 * stride + x, weighed_avx2(d, weights.colour.data() + 6));
    store(luma + x, weighed_avx2(sixteen_columns(sum + 3 * x), weights.luma.data()));
  }
  to_planes_from(x, difference, sum, width, weights, planes, stride, luma);
}

RELIEVO_AVX2 __m256i bit(__m256i mask, std::int16_t b) {
  return _mm256_and_si256(mask, _mm256_set1_epi16(b));
}

[[gnu::target("avx2")]] void codes_avx2(const QuickRow& row, int width, std::int16_t doubt,
                                        std::uint8_t* out) {
  const __m256i none = _mm256_setzero_si256();
  const __m256i largest = _mm256_set1_epi16(32767);
  const __m256i of_most = _mm256_set1_epi16(kClearOfMost);
  const __m256i of_doubt = _mm256_set1_epi16(static_cast<std::int16_t>(scaled(doubt, kClearOfDoubt)));
  const auto size = [largest](__m256i v) __attribute__((target("avx2"), always_inline)) {
    return _mm256_min_epu16(_mm256_abs_epi16(v), largest);
  };
  int x = 0;
  for (; x + 16 <= width; x += 16) {
    const __m256i r = load(row.red + x);
    const __m256i g = load(row.green + x);
    const __m256i b = load(row.blue + x);
    const __m256i rs = size(r), gs = size(g), bs = size(b);
    const __m256i most = _mm256_max_epi16(_mm256_max_epi16(rs, gs), bs);
    const __m256i least = _mm256_min_epi16(_mm256_min_epi16(rs, gs), bs);
    const __m256i wanted = _mm256_add_epi16(_mm256_mulhrs_epi16(most, of_most), of_doubt);
    const __m256i code = _mm256_or_si256(
        _mm256_or_si256(bit(_mm256_cmpgt_epi16(r, none), 1), bit(_mm256_cmpgt_epi16(g, none), 2)),
        _mm256_or_si256(bit(_mm256_cmpgt_epi16(b, none), 4),
                        _mm256_andnot_si256(_mm256_cmpgt_epi16(wanted, least),
                                            _mm256_set1_epi16(QuickKernels::kIsClear))));
    const __m128i bytes = _mm_packus_epi16(_mm256_castsi256_si128(code), _mm256_extracti128_si256(code, 1));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + x), bytes);
  }
  codes_from(x, row, width, doubt, out);
}

[[gnu::target("avx2")]] int crossings_avx2(const QuickRow& row, int width, std::int16_t least_rise,
                                           Crossing* out) {
  const __m256i none = _mm256_setzero_si256();
  const __m256i least = _mm256_set1_epi16(static_cast<std::int16_t>(least_rise - 1));
  const __m256i most = _mm256_set1_epi16(static_cast<std::int16_t>(1 - least_rise));
  const auto crosses = [&](const std::int16_t* d) __attribute__((target("avx2"), always_inline)) {
    const __m256i here = _mm256_cmpgt_epi16(load(d), none);
    const __m256i next = _mm256_cmpgt_epi16(load(d + 1), none);
    const __m256i rise = _mm256_subs_epi16(load(d + 2), load(d - 1));
    return _mm256_or_si256(_mm256_and_si256(_mm256_andnot_si256(here, next), _mm256_cmpgt_epi16(rise, least)),
                           _mm256_and_si256(_mm256_andnot_si256(next, here), _mm256_cmpgt_epi16(most, rise)));
  };
  int count = 0;
  int x = 1;
  for (; x + 18 <= width; x += 16) {
    const __m256i red = crosses(row.red + x);
    const __m256i green = crosses(row.green + x);
    const __m256i blue = crosses(row.blue + x);
    // Columns 0-7 of a mask's lower 16 bits are the first of its two, 8-15 those of the upper 16.
    const auto rg = static_cast<unsigned>(_mm256_movemask_epi8(_mm256_packs_epi16(red, green)));
    const auto bb = static_cast<unsigned>(_mm256_movemask_epi8(_mm256_packs_epi16(blue, blue)));
    const unsigned r = (rg & 0xff) | (rg >> 8 & 0xff00);
    const unsigned g = (rg >> 8 & 0xff) | (rg >> 16 & 0xff00);
    const unsigned b = (bb & 0xff) | (bb >> 8 & 0xff00);
    for (unsigned any = r | g | b; any != 0; any &= any - 1) {
      const auto column = static_cast<unsigned>(std::countr_zero(any));
      out[count++] = {
          static_cast<std::uint16_t>(static_cast<unsigned>(x) + column),
          static_cast<std::uint16_t>((r >> column & 1) | (g >> column & 1) << 1 | (b >> column & 1) << 2)};
    }
  }
  return count + crossings_from(x, row, width, least_rise, out + count);
}

/// Four samples next to each other from each of eight places of a plane: the first of all, and so on.
struct EightTimesFour {
  __m256 first, second, third, fourth;
};
RELIEVO_AVX2 EightTimesFour samples_at(const std::int16_t* plane, const Crossing* crossings) {
  const auto at = [&](int i) __attribute__((target("avx2"), always_inline)) {
    return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(plane + crossings[i].x - 1));
  };
  const __m128i a = _mm_unpacklo_epi16(at(0), at(1));
  const __m128i b = _mm_unpacklo_epi16(at(2), at(3));
  const __m128i c = _mm_unpacklo_epi16(at(4), at(5));
  const __m128i d = _mm_unpacklo_epi16(at(6), at(7));
  const __m128i ab = _mm_unpacklo_epi32(a, b), ab_high = _mm_unpackhi_epi32(a, b);
  const __m128i cd = _mm_unpacklo_epi32(c, d), cd_high = _mm_unpackhi_epi32(c, d);
  const auto real = [&](__m128i v) __attribute__((target("avx2"), always_inline)) {
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(v));
  };
  return {real(_mm_unpacklo_epi64(ab, cd)), real(_mm_unpackhi_epi64(ab, cd)),
          real(_mm_unpacklo_epi64(ab_high, cd_high)), real(_mm_unpackhi_epi64(ab_high, cd_high))};
}

/// As weigh_crossing(), of eight.
RELIEVO_AVX2 void weigh_eight(const QuickRow& row, const Crossing* crossings, QuickPlace* out) {
  const __m256i both = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(crossings));
  __m256 weight = _mm256_setzero_ps();
  __m256 sum = _mm256_setzero_ps();
  const auto take = [&](const std::int16_t* plane, int channel)
      __attribute__((target("avx2"), always_inline)) {
    const EightTimesFour s = samples_at(plane, crossings);
    __m256 behind;
    crossing_of(s.first, s.second, s.third, s.fourth, behind);
    const __m256 lanes = _mm256_castsi256_ps(_mm256_srai_epi32(_mm256_slli_epi32(both, 15 - channel), 31));
    const __m256 step = _mm256_sub_ps(s.third, s.second);
    const __m256 square = _mm256_mul_ps(step, step);
    weight = _mm256_add_ps(weight, _mm256_and_ps(square, lanes));
    sum = _mm256_add_ps(sum, _mm256_and_ps(_mm256_mul_ps(square, behind), lanes));
  };
  take(row.red, 0);
  take(row.green, 1);
  take(row.blue, 2);
  const __m256 low = _mm256_unpacklo_ps(sum, weight);
  const __m256 high = _mm256_unpackhi_ps(sum, weight);
  _mm256_storeu_ps(&out->column_px, _mm256_permute2f128_ps(low, high, 0x20));
  _mm256_storeu_ps(&out[4].column_px, _mm256_permute2f128_ps(low, high, 0x31));
}

[[gnu::target("avx2")]] int gather_avx2(const QuickRow& row, const Crossing* crossings, int count,
                                        QuickPlace* out) {
  int i = 0;
  for (; i + 8 <= count; i += 8) weigh_eight(row, crossings + i, out + i);
  for (; i < count; ++i) weigh_crossing(row, crossings[i], out[i]);
  return merge_body(crossings, count, out);
}

RELIEVO_AVX2 __m128i four(const std::int16_t* p) {
  return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p));
}

[[gnu::target("avx2")]] void sides_avx2(const QuickRow& row, const QuickSpans& spans, QuickSides& out) {
  const __m128i places = _mm_setr_epi16(0, 1, 2, 3, 0, 1, 2, 3);
  const auto sums = [&](int first, int count) __attribute__((target("avx2"), always_inline)) {
    const __m128i ones = _mm_and_si128(
        _mm_cmpgt_epi16(_mm_set1_epi16(static_cast<std::int16_t>(count)), places), _mm_set1_epi16(1));
    const __m128i rg =
        _mm_madd_epi16(_mm_unpacklo_epi64(four(row.red + first), four(row.green + first)), ones);
    const __m128i b = _mm_madd_epi16(four(row.blue + first), ones);
    return _mm_cvtepi32_ps(_mm_hadd_epi32(rg, b));
  };
  _mm_storeu_ps(out.left.data(), sums(spans.left_first, spans.left_count));
  _mm_storeu_ps(out.right.data(), sums(spans.right_first, spans.right_count));
}

[[gnu::target("avx2")]] void extremes_avx2(const std::int16_t* above, const std::int16_t* here,
                                           const std::int16_t* below, int width, std::int16_t* brightest,
                                           std::int16_t* darkest) {
  extremes_body(above, here, below, width, brightest, darkest);
}

#endif

}  // namespace

static_assert(sizeof(Crossing) == 4 && offsetof(Crossing, channels) == 2);
static_assert(sizeof(QuickPlace) == 8 && offsetof(QuickPlace, slope) == 4);

const std::vector<QuickKernels>& all_quick_kernels() {
  const QuickKernels portable{"portable",      to_planes_portable, codes_portable,   crossings_portable,
                              gather_portable, sides_portable,     extremes_portable};
#if defined(__x86_64__)
  static const auto kernels = variants(
      portable, {"avx2", to_planes_avx2, codes_avx2, crossings_avx2, gather_avx2, sides_avx2, extremes_avx2});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const QuickKernels& quick_kernels() {
  return all_quick_kernels().back();
}

}  // namespace relievo
