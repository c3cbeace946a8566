// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/line_path.h"

#include <algorithm>
#include <cstring>
#include <limits>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace relievo {
namespace {

constexpr std::size_t kPlaces = kPathCandidates;
constexpr float kNever = -std::numeric_limits<float>::infinity();

/// Tells `each` the boundaries whose own agreement is near enough the best, and their gains.
template <class Each>
void for_near(const BoundaryColours& colours, const EdgeAgreement& edge, const GainRules& rules,
              const Each& each) {
  const auto count = static_cast<std::size_t>(colours.count);
  const auto own = [&](std::size_t b) {
    return edge.left[static_cast<std::size_t>(colours.left[b])] +
           edge.right[static_cast<std::size_t>(colours.right[b])];
  };
  float best_own = kNever;
  for (std::size_t b = 0; b < count; ++b) best_own = std::max(best_own, own(b));
  const float least = std::max(0.F, best_own - rules.transition_slack);
  for (std::size_t b = 0; b < count; ++b) {
    if (own(b) < least) continue;
    const float left = edge.other_left[static_cast<std::size_t>(colours.other_left[b])];
    const float right = edge.other_right[static_cast<std::size_t>(colours.other_right[b])];
    const float other =
        edge.tracked ? left + right - (std::min(left, right) < rules.contradiction ? rules.contradicted : 0)
                     : std::max(rules.other_floor, left + right);
    each(static_cast<std::int32_t>(b), own(b) + other - rules.threshold);
  }
}

int near_portable(const BoundaryColours& colours, const EdgeAgreement& edge, const GainRules& rules,
                  std::int32_t* boundary, float* gain) {
  int used = 0;
  for_near(colours, edge, rules, [&](std::int32_t b, float g) {
    boundary[used] = b;
    gain[used++] = g;
  });
  return used;
}

int choose_portable(const BoundaryColours& colours, const EdgeAgreement& edge, const GainRules& rules,
                    std::int32_t* boundary, float* gain) {
  BestCandidates best(boundary, gain);
  for_near(colours, edge, rules, [&](std::int32_t b, float g) { best.add(b, g); });
  return best.used();
}

// Eight numbers at once; a processor with narrower registers takes several for them.
using Eight = float __attribute__((vector_size(32), aligned(4), may_alias));
using EightInts = std::int32_t __attribute__((vector_size(32), aligned(4), may_alias));

/// For an edge with one candidate.
[[gnu::always_inline]] inline void extend_one(const PathStep& step, const OrderRules& rules,
                                              PathCandidates& candidates) {
  const auto own = static_cast<std::size_t>(step.edge) * kPlaces;
  const std::int32_t before = candidates.boundary[own] - 1;
  float value = 0;
  std::int32_t from = -1;
  for (int edge = step.first; edge < step.edge; ++edge) {
    const int begin = edge * kPathCandidates;
    const int end = begin + candidates.used[static_cast<std::size_t>(edge)];
    for (int p = begin; p < end; ++p) {
      const std::int32_t missing = before - candidates.boundary[static_cast<std::size_t>(p)];
      if (missing < 0 || missing > rules.max_missing) continue;
      const float by_way = (candidates.best[static_cast<std::size_t>(p)] + rules.in_order) -
                           rules.per_missing * static_cast<float>(missing);
      from = by_way > value ? p : from;
      value = by_way > value ? by_way : value;
    }
  }
  const bool start = !(value > step.start);
  candidates.best[own] = (start ? step.start : value) + candidates.gain[own];
  candidates.from[own] = start ? step.start_from : from;
}

[[gnu::always_inline]] inline void extend_body(const PathStep& step, const OrderRules& rules,
                                               PathCandidates& candidates) {
  if (candidates.used[static_cast<std::size_t>(step.edge)] == 1) {
    extend_one(step, rules, candidates);
    return;
  }
  const std::int32_t* boundary = candidates.boundary.data();
  const float* best = candidates.best.data();
  const int own = step.edge * kPathCandidates;
  // The boundary before each candidate's own, as a path in order comes from it.
  const EightInts before = *reinterpret_cast<const EightInts*>(boundary + own) - 1;
  Eight value{};
  EightInts from = EightInts{} - 1;
  for (int edge = step.first; edge < step.edge; ++edge) {
    const int begin = edge * kPathCandidates;
    const int end = begin + candidates.used[static_cast<std::size_t>(edge)];
    for (int p = begin; p < end; ++p) {
      const EightInts missing = before - boundary[p];
      const Eight by_way =
          (best[p] + rules.in_order) - rules.per_missing * __builtin_convertvector(missing, Eight);
      const EightInts better = (missing >= 0) & (missing <= rules.max_missing) & (by_way > value);
      value = better ? by_way : value;
      from = better ? EightInts{} + p : from;
    }
  }
  const EightInts start = !(value > step.start);
  value = start ? Eight{} + step.start : value;
  from = start ? EightInts{} + step.start_from : from;
  *reinterpret_cast<Eight*>(candidates.best.data() + own) =
      value + *reinterpret_cast<const Eight*>(candidates.gain.data() + own);
  *reinterpret_cast<EightInts*>(candidates.from.data() + own) = from;
}

void extend_portable(const PathStep& step, const OrderRules& rules, PathCandidates& candidates) {
  extend_body(step, rules, candidates);
}

#if defined(__x86_64__)

[[gnu::target("avx2")]] void extend_avx2(const PathStep& step, const OrderRules& rules,
                                         PathCandidates& candidates) {
  extend_body(step, rules, candidates);
}

/// For each set of eight lanes, their numbers in order: what moves them to the front.
constexpr std::array<std::array<std::uint8_t, 8>, 256> kPack = [] {
  std::array<std::array<std::uint8_t, 8>, 256> out{};
  for (std::size_t mask = 0; mask < 256; ++mask) {
    std::size_t n = 0;
    for (std::uint8_t lane = 0; lane < 8; ++lane)
      if (mask >> lane & 1) out[mask][n++] = lane;
  }
  return out;
}();

/// Appends the lanes in `mask` at `size`; writes eight places whatever their number.
[[gnu::target("avx2"), gnu::always_inline]] inline std::size_t append(__m256 gains, __m256i boundaries,
                                                                      unsigned mask, float* gain,
                                                                      std::int32_t* boundary,
                                                                      std::size_t size) {
  const __m256i order =
      _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(kPack[mask].data())));
  _mm256_storeu_ps(gain + size, _mm256_permutevar8x32_ps(gains, order));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(boundary + size),
                      _mm256_permutevar8x32_epi32(boundaries, order));
  return size + static_cast<std::size_t>(__builtin_popcount(mask));
}

[[gnu::target("avx2"), gnu::always_inline]] inline __m256i load(const std::vector<std::int32_t>& from,
                                                                std::size_t at) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from.data() + at));
}

constexpr std::size_t kBlock = 1024;  // boundaries looked at at once; a longer pattern is the reference's

/// Gains of those near enough, packed; and the best of each lane.
[[gnu::target("avx2")]] std::size_t pack_near(const BoundaryColours& colours, const EdgeAgreement& edge,
                                              const GainRules& rules, std::int32_t* boundary_of,
                                              float* gain_of, __m256& lane_best) {
  const auto count = static_cast<std::size_t>(colours.count);
  const __m256 left = _mm256_loadu_ps(edge.left.data());
  const __m256 right = _mm256_loadu_ps(edge.right.data());
  const __m256 other_left = _mm256_loadu_ps(edge.other_left.data());
  const __m256 other_right = _mm256_loadu_ps(edge.other_right.data());
  alignas(32) std::array<float, kBlock> own_of;
  __m256 best = _mm256_set1_ps(kNever);
  for (std::size_t b = 0; b < count; b += 8) {
    const __m256 own = _mm256_add_ps(_mm256_permutevar8x32_ps(left, load(colours.left, b)),
                                     _mm256_permutevar8x32_ps(right, load(colours.right, b)));
    _mm256_store_ps(own_of.data() + b, own);
    best = _mm256_max_ps(best, own);
  }
  best = _mm256_max_ps(best, _mm256_permute2f128_ps(best, best, 1));
  best = _mm256_max_ps(best, _mm256_shuffle_ps(best, best, 0x4e));
  best = _mm256_max_ps(best, _mm256_shuffle_ps(best, best, 0xb1));
  const __m256 least =
      _mm256_max_ps(_mm256_setzero_ps(), _mm256_sub_ps(best, _mm256_set1_ps(rules.transition_slack)));
  std::size_t size = 0;
  const __m256 never = _mm256_set1_ps(kNever);
  lane_best = never;
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  for (std::size_t b = 0; b < count; b += 8) {
    const __m256 own = _mm256_load_ps(own_of.data() + b);
    const __m256 near = _mm256_cmp_ps(own, least, _CMP_GE_OQ);
    const auto mask = static_cast<unsigned>(_mm256_movemask_ps(near));
    if (mask == 0) continue;
    const __m256 l = _mm256_permutevar8x32_ps(other_left, load(colours.other_left, b));
    const __m256 r = _mm256_permutevar8x32_ps(other_right, load(colours.other_right, b));
    const __m256 sum = _mm256_add_ps(l, r);
    const __m256 other =
        edge.tracked
            ? _mm256_sub_ps(sum, _mm256_and_ps(_mm256_cmp_ps(_mm256_min_ps(l, r),
                                                             _mm256_set1_ps(rules.contradiction), _CMP_LT_OQ),
                                               _mm256_set1_ps(rules.contradicted)))
            : _mm256_max_ps(_mm256_set1_ps(rules.other_floor), sum);
    const __m256 g = _mm256_sub_ps(_mm256_add_ps(own, other), _mm256_set1_ps(rules.threshold));
    lane_best = _mm256_max_ps(lane_best, _mm256_blendv_ps(never, g, near));
    size = append(g, _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(b))), mask, gain_of,
                  boundary_of, size);
  }
  return size;
}

[[gnu::target("avx2")]] int near_avx2(const BoundaryColours& colours, const EdgeAgreement& edge,
                                      const GainRules& rules, std::int32_t* boundary, float* gain) {
  if (static_cast<std::size_t>(colours.count) > kBlock)
    return near_portable(colours, edge, rules, boundary, gain);
  __m256 lane_best;
  return static_cast<int>(pack_near(colours, edge, rules, boundary, gain, lane_best));
}

[[gnu::target("avx2")]] int choose_avx2(const BoundaryColours& colours, const EdgeAgreement& edge,
                                        const GainRules& rules, std::int32_t* boundary, float* gain) {
  if (static_cast<std::size_t>(colours.count) > kBlock)
    return choose_portable(colours, edge, rules, boundary, gain);
  // Eight of the best of each lane are not below the worst of these, so nothing below it is among the eight
  // best.
  std::array<float, kBlock + 8> gain_of;
  std::array<std::int32_t, kBlock + 8> boundary_of;
  std::array<std::uint8_t, kBlock / 8> stays;
  __m256 lane_best;
  std::size_t size = pack_near(colours, edge, rules, boundary_of.data(), gain_of.data(), lane_best);
  if (size == 0) return 0;  // nothing was written
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  if (size > kPlaces) {
    __m256 worst = _mm256_min_ps(lane_best, _mm256_permute2f128_ps(lane_best, lane_best, 1));
    worst = _mm256_min_ps(worst, _mm256_shuffle_ps(worst, worst, 0x4e));
    worst = _mm256_min_ps(worst, _mm256_shuffle_ps(worst, worst, 0xb1));
    const std::size_t all = size;
    size = 0;
    for (std::size_t i = 0; i < all; i += 8) {
      const __m256 g = _mm256_loadu_ps(gain_of.data() + i);
      unsigned mask = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(g, worst, _CMP_GE_OQ)));
      if (all - i < 8) mask &= (1U << (all - i)) - 1;
      const __m256i b = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(boundary_of.data() + i));
      size = append(g, b, mask, gain_of.data(), boundary_of.data(), size);
    }
  }
  if (size > kPlaces) {
    // A candidate stays where fewer than eight are better; of equal ones the first is.
    const std::size_t all = size;
    size = 0;
    for (std::size_t i = 0; i < all; i += 8) {
      const __m256 g = _mm256_loadu_ps(gain_of.data() + i);
      const __m256i places = _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(i)));
      __m256i better = _mm256_setzero_si256();  // as many, negative
      for (std::size_t j = 0; j < all; ++j) {
        const __m256 than = _mm256_broadcast_ss(gain_of.data() + j);
        const __m256i first = _mm256_cmpgt_epi32(places, _mm256_set1_epi32(static_cast<int>(j)));
        const __m256 wins =
            _mm256_or_ps(_mm256_cmp_ps(than, g, _CMP_GT_OQ),
                         _mm256_and_ps(_mm256_cmp_ps(than, g, _CMP_EQ_OQ), _mm256_castsi256_ps(first)));
        better = _mm256_add_epi32(better, _mm256_castps_si256(wins));
      }
      stays[i / 8] = static_cast<std::uint8_t>(_mm256_movemask_ps(
          _mm256_castsi256_ps(_mm256_cmpgt_epi32(better, _mm256_set1_epi32(-static_cast<int>(kPlaces))))));
    }
    for (std::size_t i = 0; i < all; i += 8) {
      unsigned mask = stays[i / 8];
      if (all - i < 8) mask &= (1U << (all - i)) - 1;
      size = append(_mm256_loadu_ps(gain_of.data() + i),
                    _mm256_loadu_si256(reinterpret_cast<const __m256i*>(boundary_of.data() + i)), mask,
                    gain_of.data(), boundary_of.data(), size);
    }
  }
  _mm256_storeu_ps(gain, _mm256_loadu_ps(gain_of.data()));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(boundary),
                      _mm256_loadu_si256(reinterpret_cast<const __m256i*>(boundary_of.data())));
  return static_cast<int>(size);
}

#endif

}  // namespace

void BestCandidates::add(std::int32_t boundary, float gain) {
  if (used_ == kPathCandidates) {
    if (gain_[worst_] >= gain) return;
    std::copy(boundary_ + worst_ + 1, boundary_ + used_, boundary_ + worst_);
    std::copy(gain_ + worst_ + 1, gain_ + used_, gain_ + worst_);
    --used_;
  }
  boundary_[used_] = boundary;
  gain_[used_++] = gain;
  if (used_ < kPathCandidates) return;
  worst_ = 0;
  for (int i = 1; i < used_; ++i) worst_ = gain_[i] <= gain_[worst_] ? i : worst_;
}

void BoundaryColours::add(Primary l, Primary r, Primary ol, Primary o_r) {
  left.push_back(l);
  right.push_back(r);
  other_left.push_back(ol);
  other_right.push_back(o_r);
  ++count;
}

void BoundaryColours::fill_up() {
  while (count % 8 != 0) add(0, 0, 0, 0);
}

void PathCandidates::resize(std::size_t edges) {
  used.resize(edges);
  boundary.resize(edges * kPlaces);
  gain.resize(edges * kPlaces);
  best.resize(edges * kPlaces);
  from.resize(edges * kPlaces);
}

const std::vector<PathKernels>& all_path_kernels() {
  static const std::vector<PathKernels> kernels = [] {
    std::vector<PathKernels> out{{"portable", choose_portable, near_portable, extend_portable}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", choose_avx2, near_avx2, extend_avx2});
#endif
    return out;
  }();
  return kernels;
}

const PathKernels& path_kernels() {
  return all_path_kernels().back();
}

}  // namespace relievo
