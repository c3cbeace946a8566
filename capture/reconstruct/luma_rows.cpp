// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/luma_rows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "capture/reconstruct/crossing.h"
#include "capture/reconstruct/four.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

constexpr int kPlateau_px = 5;        // of the columns, where a side's level is measured: from 2 px on
constexpr float kFarthest_px = 2.5F;  // between colour's place and luma's
constexpr float kLevelSlack = 0.1F;   // of a side's luma ratio about what the code tells
static_assert(kPlateau_px < LumaView::kMargin);
static_assert(std::endian::native == std::endian::little, "clear_run() counts bytes from the lowest");

// Compiled once for every set of instructions, as in rows.cpp.
#define RELIEVO_BODY [[gnu::always_inline]] inline

RELIEVO_BODY void ratios_body(const float* __restrict red, const float* __restrict green,
                              const float* __restrict blue, const float* __restrict white, int count,
                              const std::array<float, 3> weights, float dark, float* __restrict red_out,
                              float* __restrict green_out, float* __restrict blue_out,
                              float* __restrict luma_out) {
  for (int x = 0; x < count; ++x) {
    const float unit = 1.F / (white[x] + dark);
    const float r = red[x] * unit;
    const float g = green[x] * unit;
    const float b = blue[x] * unit;
    red_out[x] = r;
    green_out[x] = g;
    blue_out[x] = b;
    luma_out[x] = weights[0] * r + weights[1] * g + weights[2] * b;
  }
}

RELIEVO_BODY void ends_body(const float* __restrict white, int count, float share, float dark,
                            std::uint8_t* __restrict ends) {
  for (int x = 0; x < count; ++x)
    ends[x] = std::fabs(white[x + 1] - white[x - 1]) > share * (white[x + 1] + white[x - 1] + dark) ? 1 : 0;
}

RELIEVO_BODY void extremes_body(const WhiteRows rows, int count, bool wide_stripes,
                                float* __restrict brightest, float* __restrict darkest) {
  const float* a = rows.above;
  const float* h = rows.here;
  const float* b = rows.below;
  for (int x = 0; x < count; ++x) brightest[x] = std::max(std::max(a[x], h[x]), b[x]);
  if (!wide_stripes) {
    for (int x = 0; x < count; ++x) darkest[x] = std::min(std::min(a[x], h[x]), b[x]);
    return;
  }
  const auto of_three = [](const float* w, int x) __attribute__((always_inline)) {
    return std::max(std::max(w[x - 1], w[x]), w[x + 1]);
  };
  for (int x = 0; x < count; ++x)
    darkest[x] = std::min(std::min(of_three(a, x), of_three(h, x)), of_three(b, x));
}

template <int around>
RELIEVO_BODY void contrasts_within(const float* __restrict brightest, const float* __restrict darkest,
                                   int count, float dark, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float most = brightest[x - around];
    float least = darkest[x - around];
    for (int i = 1 - around; i <= around; ++i) {
      most = std::max(most, brightest[x + i]);
      least = std::min(least, darkest[x + i]);
    }
    out[x] = (most - least) / (most + least + dark);
  }
}

RELIEVO_BODY void contrasts_body(const float* brightest, const float* darkest, int count, int around,
                                 float dark, float* out) {
  if (around == 2) {
    contrasts_within<2>(brightest, darkest, count, dark, out);
  } else {
    contrasts_within<4>(brightest, darkest, count, dark, out);
  }
}

/// Of red, green, blue and luma at once, or of any others.
RELIEVO_BODY Four size_of(Four v) {
  return v < 0 ? -v : v;
}

/// Of a column that is not negative; a call of std::lround takes ten times as long.
RELIEVO_BODY int column_of(float column_px) {
  return static_cast<int>(column_px + 0.5F);
}

/// Columns from the one at `ends` on in a direction (-1 or 1) that show the same surface in the same light,
/// as far as luma tells, kMargin + 1 at most.
RELIEVO_BODY int clear_run(const std::uint8_t* ends, int direction) {
  std::uint64_t eight = 0;
  std::memcpy(&eight, direction > 0 ? ends + 1 : ends - 8, sizeof eight);
  return 1 + (direction > 0 ? std::countr_zero(eight) : std::countl_zero(eight)) / 8;
}

RELIEVO_BODY int reach_in(float free_px) {
  return std::clamp(static_cast<int>(free_px - 2.F), 2, kPlateau_px);
}

/// How far to each side of `middle` a plateau goes, from two columns away on; 1 or less: there is none.
struct Plateaus {
  int left, right;
};
RELIEVO_BODY Plateaus plateaus(const std::uint8_t* ends, int centre, int middle, int left_reach,
                               int right_reach) {
  const int off = middle - centre;
  return {std::min({left_reach, clear_run(ends + middle, -1) - 1, kLumaReach_px + off}),
          std::min({right_reach, clear_run(ends + middle, 1) - 1, kLumaReach_px - off})};
}

/// Levels of the two sides: what is measured, about what the code tells.
struct Levels {
  float left, right;
};
RELIEVO_BODY Levels levels_of(const std::array<float, 2>& measured, const std::array<float, 2>& expected,
                              bool left_seen, bool right_seen) {
  const auto level = [&](std::size_t s, bool seen, bool other_seen) __attribute__((always_inline)) {
    if (seen) return std::clamp(measured[s], expected[s] - kLevelSlack, expected[s] + kLevelSlack);
    const float off = measured[1 - s] - expected[1 - s];
    return expected[s] + (other_seen ? std::clamp(off, -kLevelSlack, kLevelSlack) : 0);
  };
  return {level(0, left_seen, right_seen), level(1, right_seen, left_seen)};
}

LumaPlace place_portable(const LumaView& view, const LumaLight& light, const LumaQuery& query) {
  const LumaSides& sides = query.sides;
  const int centre = column_of(query.own_px);
  const std::uint8_t* ends = view.ends - view.first;
  const auto at = [&](int x) {
    x -= view.first;
    return Four{view.red[x], view.green[x], view.blue[x], view.luma[x]};
  };
  const Four weights{light.weights[0], light.weights[1], light.weights[2], 0};
  LumaPlace out{.column_px = query.own_px};
  float place = query.own_px;
  std::array<int, 3> last{};
  for (int round = 0; round < 2; ++round) {
    const int middle = column_of(place);
    const std::array columns{middle, reach_in(sides.free_left_px + (place - query.own_px)),
                             reach_in(sides.free_right_px - (place - query.own_px))};
    if (round > 0 && columns == last) break;  // it would find the same
    last = columns;
    // Plateaus of both sides, and how strong each channel comes back from this surface.
    const Plateaus furthest = plateaus(ends, centre, middle, columns[1], columns[2]);
    std::array<float, 2> measured{};
    std::array<int, 2> samples{};
    Four amplitude{};
    for (std::size_t s = 0; s < 2; ++s) {
      const int direction = s == 0 ? -1 : 1;
      const int last_of_side = s == 0 ? furthest.left : furthest.right;
      samples[s] = std::max(0, last_of_side - 1);
      if (samples[s] == 0) {
        if (!sides.narrow) continue;
        // Between two steps: the nearest sample still tells the surface's channels, but no level.
        const Four nearest = size_of(at(middle + direction));
        amplitude = amplitude < nearest ? nearest : amplitude;
        continue;
      }
      Four sum{};
      for (int i = 2; i <= last_of_side; ++i) sum += at(middle + direction * i);
      const Four mean = sum / static_cast<float>(samples[s]);
      measured[s] = mean[3];
      const Four size = size_of(mean);
      amplitude = amplitude < size ? size : amplitude;
    }
    // Expected levels: this surface's channels under the code's colours. A surface in the projector's white
    // light alone would have `share`.
    const Four parts = weights * amplitude;
    const float total = parts[0] + parts[1] + parts[2];
    if (!(total > 0)) return out;
    const Four part = parts * light.share / total;
    std::array<float, 2> expected{};
    for (std::size_t s = 0; s < 2; ++s)
      for (int c = 0; c < 3; ++c) expected[s] += (sides.colours[s] >> c & 1) ? part[c] : -part[c];
    const Levels levels = levels_of(measured, expected, samples[0] > 0, samples[1] > 0);
    const float level = 0.5F * (levels.left + levels.right);
    const bool rising = levels.right > levels.left;
    out.rise = levels.right - levels.left;
    out.found = false;
    float nearest = kFarthest_px;
    for (int x = centre - 4; x < centre + 4; ++x) {
      const float a = view.luma[x - view.first] - level;
      const float b = view.luma[x + 1 - view.first] - level;
      if ((a > 0) == (b > 0) || (b > a) != rising) continue;
      const float column = static_cast<float>(x) + crossing_behind(view.luma + (x - view.first), level);
      if (std::fabs(column - place) >= nearest) continue;
      nearest = std::fabs(column - place);
      out.column_px = column;
      out.slope = std::fabs(b - a);
      out.found = true;
    }
    if (!out.found) return out;
    place = out.column_px;
  }
  return out;
}

void places_portable(const LumaView& view, const LumaLight& light, const LumaQuery* queries, int count,
                     LumaPlace* out) {
  for (int i = 0; i < count; ++i) out[i] = place_portable(view, light, queries[i]);
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

/// Four columns of a row on each side, the left ones in the lower half.
RELIEVO_AVX2 __m256 both_sides(const float* left, const float* right) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(left)), _mm_loadu_ps(right), 1);
}

/// (x[0] + x[1]) + x[2] of each half, in its first place.
RELIEVO_AVX2 __m256 sum_of_three(__m256 x) {
  const __m256 first = _mm256_add_ps(x, _mm256_shuffle_ps(x, x, 0xb1));
  return _mm256_add_ps(first, _mm256_shuffle_ps(x, x, 0xaa));
}

/// What a primary's missing channels turn round.
alignas(16) constexpr std::array<std::array<std::uint32_t, 4>, 8> kSigns = [] {
  std::array<std::array<std::uint32_t, 4>, 8> out{};
  for (std::uint32_t colour = 0; colour < 8; ++colour)
    for (std::size_t c = 0; c < 3; ++c) out[colour][c] = (colour >> c & 1) ? 0U : 0x80000000U;
  return out;
}();

/// What a round of place_portable() looks at.
struct Round {
  int middle, left_reach, right_reach;
  bool operator==(const Round&) const = default;
};
RELIEVO_BODY Round round_at(const LumaQuery& query, float place) {
  return {column_of(place), reach_in(query.sides.free_left_px + (place - query.own_px)),
          reach_in(query.sides.free_right_px - (place - query.own_px))};
}

/// A round of place_portable(), channels and sides at once, from `place`. False where no other may follow.
RELIEVO_AVX2 bool round_avx2(const LumaView& view, const LumaLight& light, const LumaQuery& query,
                             const Round& round, float place, LumaPlace& out) {
  const LumaSides& sides = query.sides;
  const int centre = column_of(query.own_px);
  const int middle = round.middle;
  const __m256 sign = _mm256_set1_ps(-0.F);
  const __m128 weights = _mm_setr_ps(light.weights[0], light.weights[1], light.weights[2], 0);
  const __m256 turned = both_sides(reinterpret_cast<const float*>(kSigns[sides.colours[0]].data()),
                                   reinterpret_cast<const float*>(kSigns[sides.colours[1]].data()));
  const Plateaus furthest =
      plateaus(view.ends - view.first, centre, middle, round.left_reach, round.right_reach);
  if (sides.narrow && std::min(furthest.left, furthest.right) < 2) {
    out = place_portable(view, light, query);
    return false;
  }

  const __m256i away = _mm256_setr_epi32(5, 4, 3, 2, 2, 3, 4, 5);
  const __m256i limit = _mm256_set_m128i(_mm_set1_epi32(furthest.right), _mm_set1_epi32(furthest.left));
  const __m256 beyond = _mm256_castsi256_ps(_mm256_cmpgt_epi32(away, limit));
  const int x = middle - view.first;
  const auto row = [&](const float* r) __attribute__((target("avx2"), always_inline)) {
    return _mm256_andnot_ps(beyond, both_sides(r + x - 5, r + x + 2));
  };
  const __m256 red = row(view.red);
  const __m256 green = row(view.green);
  const __m256 blue = row(view.blue);
  const __m256 luma = row(view.luma);
  // Columns of all channels, and those two away first on either side.
  const __m256 rg_low = _mm256_unpacklo_ps(red, green);
  const __m256 rg_high = _mm256_unpackhi_ps(red, green);
  const __m256 bl_low = _mm256_unpacklo_ps(blue, luma);
  const __m256 bl_high = _mm256_unpackhi_ps(blue, luma);
  const __m256 c0 = _mm256_shuffle_ps(rg_low, bl_low, 0x44);
  const __m256 c1 = _mm256_shuffle_ps(rg_low, bl_low, 0xee);
  const __m256 c2 = _mm256_shuffle_ps(rg_high, bl_high, 0x44);
  const __m256 c3 = _mm256_shuffle_ps(rg_high, bl_high, 0xee);
  __m256 sum = _mm256_add_ps(_mm256_blend_ps(c3, c0, 0xf0), _mm256_blend_ps(c2, c1, 0xf0));
  sum = _mm256_add_ps(sum, _mm256_blend_ps(c1, c2, 0xf0));
  sum = _mm256_add_ps(sum, _mm256_blend_ps(c0, c3, 0xf0));
  const __m256i samples =
      _mm256_max_epi32(_mm256_sub_epi32(limit, _mm256_set1_epi32(1)), _mm256_set1_epi32(1));
  const __m256 mean = _mm256_div_ps(sum, _mm256_cvtepi32_ps(samples));
  const __m256 size = _mm256_andnot_ps(sign, mean);
  const __m128 amplitude = _mm_max_ps(_mm256_castps256_ps128(size), _mm256_extractf128_ps(size, 1));
  const __m128 parts = _mm_mul_ps(weights, amplitude);
  const __m256 parts_twice = _mm256_set_m128(parts, parts);
  const __m256 total = sum_of_three(parts_twice);
  if (!(_mm256_cvtss_f32(total) > 0)) return false;
  const __m256 part = _mm256_div_ps(_mm256_mul_ps(parts_twice, _mm256_set1_ps(light.share)),
                                    _mm256_shuffle_ps(total, total, 0));
  const __m256 told = sum_of_three(_mm256_xor_ps(part, turned));
  const __m256 levels_seen = _mm256_shuffle_ps(mean, mean, 0xff);
  const Levels levels =
      levels_of({_mm256_cvtss_f32(levels_seen), _mm_cvtss_f32(_mm256_extractf128_ps(levels_seen, 1))},
                {_mm256_cvtss_f32(told), _mm_cvtss_f32(_mm256_extractf128_ps(told, 1))}, furthest.left > 1,
                furthest.right > 1);
  const float level = 0.5F * (levels.left + levels.right);
  const bool rising = levels.right > levels.left;
  out.rise = levels.right - levels.left;
  out.found = false;

  const float* around = view.luma + (centre - 4 - view.first);
  const auto beside = [&](int off) __attribute__((target("avx2"), always_inline)) {
    return _mm256_sub_ps(_mm256_loadu_ps(around + off), _mm256_set1_ps(level));
  };
  const __m256 a = beside(0);
  const __m256 b = beside(1);
  const __m256 zero = _mm256_setzero_ps();
  const __m256 crosses =
      _mm256_xor_ps(_mm256_cmp_ps(a, zero, _CMP_GT_OQ), _mm256_cmp_ps(b, zero, _CMP_GT_OQ));
  const __m256 falls =
      _mm256_xor_ps(_mm256_cmp_ps(b, a, _CMP_GT_OQ), _mm256_castsi256_ps(_mm256_set1_epi32(rising ? -1 : 0)));
  const __m256 step = _mm256_sub_ps(b, a);
  const __m256 x_of = _mm256_cvtepi32_ps(
      _mm256_add_epi32(_mm256_set1_epi32(centre - 4), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)));
  __m256 behind;
  crossing_of(beside(-1), a, b, beside(2), behind);
  const __m256 column = _mm256_add_ps(x_of, behind);
  const __m256 off = _mm256_andnot_ps(sign, _mm256_sub_ps(column, _mm256_set1_ps(place)));
  const __m256 near = _mm256_cmp_ps(off, _mm256_set1_ps(kFarthest_px), _CMP_LT_OQ);
  auto lanes =
      static_cast<unsigned>(_mm256_movemask_ps(_mm256_and_ps(near, _mm256_andnot_ps(falls, crosses))));
  if (lanes == 0) return false;
  alignas(32) std::array<float, 8> columns_of, steps, offs;
  _mm256_store_ps(columns_of.data(), column);
  _mm256_store_ps(steps.data(), step);
  auto best = static_cast<std::size_t>(std::countr_zero(lanes));
  if ((lanes & (lanes - 1)) != 0) {
    _mm256_store_ps(offs.data(), off);
    for (lanes &= lanes - 1; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(lanes));
      best = offs[lane] < offs[best] ? lane : best;
    }
  }
  out.column_px = columns_of[best];
  out.slope = std::fabs(steps[best]);
  out.found = true;
  return true;
}

[[gnu::target("avx2")]] void places_avx2(const LumaView& view, const LumaLight& light,
                                         const LumaQuery* queries, int count, LumaPlace* out) {
  // All first rounds and then all second ones: places next to each other do not wait for one another.
  constexpr int kBlock = 64;
  std::array<int, kBlock> again;
  for (int begin = 0; begin < count; begin += kBlock) {
    std::size_t more = 0;
    for (int i = begin; i < std::min(count, begin + kBlock); ++i) {
      const LumaQuery& query = queries[i];
      out[i] = {.column_px = query.own_px};
      const Round first = round_at(query, query.own_px);
      const bool goes_on = round_avx2(view, light, query, first, query.own_px, out[i]);
      again[more] = i;
      more += goes_on & !(round_at(query, out[i].column_px) == first);  // else it would find the same
    }
    for (std::size_t k = 0; k < more; ++k) {
      const int i = again[k];
      const float place = out[i].column_px;
      round_avx2(view, light, queries[i], round_at(queries[i], place), place, out[i]);
    }
  }
}

#endif

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes, places)                                                             \
  struct set {                                                                                               \
    attributes static void ratios(const LightRows& rows, int count, const std::array<float, 3>& weights,     \
                                  float dark, const RatioRows& out) {                                        \
      ratios_body(rows.red, rows.green, rows.blue, rows.white, count, weights, dark, out.red, out.green,     \
                  out.blue, out.luma);                                                                       \
    }                                                                                                        \
    attributes static void ends(const float* white, int count, float share, float dark, std::uint8_t* out) { \
      ends_body(white, count, share, dark, out);                                                             \
    }                                                                                                        \
    attributes static void extremes(const WhiteRows& rows, int count, bool wide_stripes, float* brightest,   \
                                    float* darkest) {                                                        \
      extremes_body(rows, count, wide_stripes, brightest, darkest);                                          \
    }                                                                                                        \
    attributes static void contrasts(const float* brightest, const float* darkest, int count, int around,    \
                                     float dark, float* out) {                                               \
      contrasts_body(brightest, darkest, count, around, dark, out);                                          \
    }                                                                                                        \
    static LumaKernels table(const char* name) { return {name, ratios, places, ends, extremes, contrasts}; } \
  }

RELIEVO_KERNELS(Portable, , places_portable);
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]], places_avx2);
#endif

}  // namespace

const std::vector<LumaKernels>& all_luma_kernels() {
  static const std::vector<LumaKernels> kernels = [] {
    std::vector<LumaKernels> out{Portable::table("portable")};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back(Avx2::table("avx2"));
#endif
    return out;
  }();
  return kernels;
}

const LumaKernels& luma_kernels() {
  return all_luma_kernels().back();
}

}  // namespace relievo
