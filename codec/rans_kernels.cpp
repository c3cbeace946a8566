// SPDX-License-Identifier: Apache-2.0
#include "codec/rans_kernels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "base/variants.h"

namespace relievo::rans {
namespace {

#define RELIEVO_INLINE [[gnu::always_inline]] inline

/// Words are written from the end on; the one before `to` is written in any case.
RELIEVO_INLINE std::uint32_t put(std::uint32_t x, const EncoderSymbol& e, std::uint16_t*& to) {
  to[-1] = static_cast<std::uint16_t>(x);
  const bool full = x >= e.limit;
  to -= full ? 1 : 0;
  x = full ? x >> 16 : x;
  const auto q = static_cast<std::uint32_t>((static_cast<std::uint64_t>(x) * e.reciprocal) >> 32) >> e.shift;
  return x + e.bias + q * e.complement;
}

/// A stream of one lane, where each symbol waits for the one before: with as few steps one after the other as
/// there can be. A quotient follows from the one before by one multiplication, as
/// (x + bias + q complement) reciprocal = (x + bias) reciprocal + q (complement reciprocal), whose second
/// product does not wait. The sum is below 2^63, so it is exact though parts of it overflow.
class SingleLane {
 public:
  explicit SingleLane(const StreamJob& job)
      : begin_(job.rows.codes.data()),
        code_(begin_ + job.rows.codes.size()),
        symbols_(job.symbols),
        x_(job.states[0]),
        to_(job.to) {
    if (code_ == begin_) return;
    symbol_ = symbols_ + *--code_;
    divide();
  }
  /// The next symbols, at most so many; the row's first one is left to finish().
  RELIEVO_INLINE void put(std::size_t most) {
    for (auto n = std::min(most, static_cast<std::size_t>(code_ - begin_)); n > 0; --n)
      put_before(symbols_ + *--code_);
  }
  RELIEVO_INLINE void finish(StreamJob& job) {
    put(static_cast<std::size_t>(code_ - begin_));
    if (symbol_ != nullptr) x_ += symbol_->bias + quotient_ * symbol_->complement;
    job.states[0] = static_cast<std::uint32_t>(x_);
    job.to = to_;
  }

 private:
  /// With a branch, since few symbols fill the state, which is foreseen.
  RELIEVO_INLINE void divide() {
    if (x_ >= symbol_->limit) [[unlikely]] {
      *--to_ = static_cast<std::uint16_t>(x_);
      x_ >>= 16;
    }
    quotient_ = x_ * symbol_->reciprocal >> (32 + symbol_->shift);
  }
  RELIEVO_INLINE void put_before(const EncoderSymbol* next) {
    const std::uint64_t complement = symbol_->complement, reciprocal = next->reciprocal;
    const std::uint64_t sum = x_ + symbol_->bias;
    std::uint64_t ahead = complement * reciprocal;
    asm("" : "+r"(ahead));  // or else compilers make one product of both
    const std::uint64_t divided = sum * reciprocal + quotient_ * ahead;
    x_ = sum + quotient_ * complement;
    quotient_ = divided >> (32 + next->shift);
    symbol_ = next;
    if (x_ >= next->limit) [[unlikely]]
      divide();
  }

  const std::uint16_t* begin_;
  const std::uint16_t* code_;
  const EncoderSymbol* symbols_;
  std::uint64_t x_;
  std::uint16_t* to_;
  const EncoderSymbol* symbol_ = nullptr;  // whose turn it is
  std::uint64_t quotient_ = 0;             // of the state by its frequency
};

/// A row, its last symbol first.
void encode_row(const std::uint16_t* begin, const std::uint16_t* end, StreamJob& job) {
  while ((end - begin) % kLanes != 0) {
    --end;
    std::uint32_t& x = job.states[static_cast<std::size_t>((end - begin) % kLanes)];
    x = put(x, job.symbols[*end], job.to);
  }
  auto [a, b, c, d] = job.states;
  for (; end != begin; end -= kLanes) {
    d = put(d, job.symbols[end[-1]], job.to);
    c = put(c, job.symbols[end[-2]], job.to);
    b = put(b, job.symbols[end[-3]], job.to);
    a = put(a, job.symbols[end[-4]], job.to);
  }
  job.states = {a, b, c, d};
}

void encode_portable(StreamJob& lanes, StreamJob& single) {
  std::size_t end = lanes.rows.codes.size();
  for (std::size_t r = lanes.rows.starts.size(); r-- > 0;) {
    const std::size_t start = lanes.rows.starts[r];
    encode_row(lanes.rows.codes.data() + start, lanes.rows.codes.data() + end, lanes);
    end = start;
  }
  SingleLane(single).finish(single);
}

#if defined(__x86_64__)

#define RELIEVO_AVX2 [[gnu::target("avx2"), gnu::always_inline]] inline

/// By which lanes are full: their words, in the lanes' order, at the end of eight bytes.
constexpr auto kFullWords = [] {
  std::array<std::array<std::uint8_t, 16>, 16> out{};
  for (std::size_t full = 0; full < 16; ++full) {
    std::size_t byte = 8 - 2 * static_cast<std::size_t>(std::popcount(full));
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if ((full >> lane & 1U) == 0) continue;
      out[full][byte++] = static_cast<std::uint8_t>(4 * lane);
      out[full][byte++] = static_cast<std::uint8_t>(4 * lane + 1);
    }
  }
  return out;
}();

RELIEVO_AVX2 __m128i load(const void* from) {
  return _mm_loadu_si128(static_cast<const __m128i*>(from));
}

/// put() of four lanes: a symbol each.
RELIEVO_AVX2 __m128i put_four(__m128i x, const EncoderSymbol* const* symbols, std::uint16_t*& to) {
  static_assert(offsetof(EncoderSymbol, limit) == 0 && offsetof(EncoderSymbol, shift) == 14);
  const __m128i a = load(symbols[0]), b = load(symbols[1]), c = load(symbols[2]), d = load(symbols[3]);
  const __m128i ab = _mm_unpacklo_epi32(a, b), cd = _mm_unpacklo_epi32(c, d);
  const __m128i limit = _mm_unpacklo_epi64(ab, cd), reciprocal = _mm_unpackhi_epi64(ab, cd);
  const __m128i ab_end = _mm_unpackhi_epi32(a, b), cd_end = _mm_unpackhi_epi32(c, d);
  const __m128i bias = _mm_unpacklo_epi64(ab_end, cd_end), both = _mm_unpackhi_epi64(ab_end, cd_end);
  // States stay below 2^31, and so do limits less one.
  const __m128i full = _mm_cmpgt_epi32(x, _mm_add_epi32(limit, _mm_set1_epi32(-1)));
  const auto mask = static_cast<unsigned>(_mm_movemask_ps(_mm_castsi128_ps(full)));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(to - 4), _mm_shuffle_epi8(x, load(kFullWords[mask].data())));
  to -= std::popcount(mask);
  x = _mm_blendv_epi8(x, _mm_srli_epi32(x, 16), full);
  const __m128i even = _mm_srli_epi64(_mm_mul_epu32(x, reciprocal), 32);
  const __m128i odd = _mm_mul_epu32(_mm_srli_epi64(x, 32), _mm_srli_epi64(reciprocal, 32));
  const __m128i product = _mm_blend_epi16(even, odd, 0b11001100);
  const __m128i q = _mm_srlv_epi32(product, _mm_srli_epi32(both, 16));
  const __m128i complement = _mm_and_si128(both, _mm_set1_epi32(0xffff));
  return _mm_add_epi32(_mm_add_epi32(x, bias), _mm_mullo_epi32(q, complement));
}

/// Of a lane that has no symbol: its state stays.
constexpr EncoderSymbol kNothing{.limit = 1U << 31};

[[gnu::target("avx2")]] void encode_avx2(StreamJob& lanes, StreamJob& single) {
  __m128i states = load(lanes.states.data());
  std::uint16_t* to = lanes.to;
  SingleLane beside(single);
  const std::size_t steps = lanes.rows.codes.size() / kLanes + 1;
  const std::size_t at_once = (single.rows.codes.size() + steps - 1) / steps;
  const EncoderSymbol* const symbols = lanes.symbols;
  const std::uint16_t* end = lanes.rows.codes.data() + lanes.rows.codes.size();
  for (std::size_t r = lanes.rows.starts.size(); r-- > 0;) {
    const std::uint16_t* const begin = lanes.rows.codes.data() + lanes.rows.starts[r];
    if (const auto rest = static_cast<std::size_t>(end - begin) % kLanes; rest != 0) {
      end -= rest;
      const EncoderSymbol* last[kLanes];
      for (std::size_t i = 0; i < kLanes; ++i) last[i] = i < rest ? symbols + end[i] : &kNothing;
      states = put_four(states, last, to);
    }
    while (end != begin) {
      end -= kLanes;
      const EncoderSymbol* const four[kLanes] = {symbols + end[0], symbols + end[1], symbols + end[2],
                                                 symbols + end[3]};
      states = put_four(states, four, to);
      beside.put(at_once);
    }
  }
  _mm_storeu_si128(reinterpret_cast<__m128i*>(lanes.states.data()), states);
  lanes.to = to;
  beside.finish(single);
}

#endif

/// What a level takes of all others' share, in bits a symbol of the table: linear about the frequencies that
/// were counted.
const std::array<float, kLargestLevel + 1>& share_costs() {
  static const auto costs = [] {
    std::array<float, kLargestLevel + 1> out{};
    for (int level = 1; level <= kLargestLevel; ++level)
      out[static_cast<std::size_t>(level)] =
          static_cast<float>(std::exp2(0.5 * (level - 1)) / kScale / std::log(2.0));
    return out;
  }();
  return costs;
}

// A table each.
using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
constexpr std::size_t kLevels = kLargestLevel + 1;
constexpr float kNever = 1e30F;

/// From which level the way to each leads, four levels to a number.
using Steps = std::array<Ints, kLevels / 4>;

/// The cheapest ways from one symbol's levels to the next one's: as write_levels() has it a level up takes
/// two bits, a level down too, and none takes one.
RELIEVO_INLINE void step(const std::array<Floats, kLevels>& best, std::array<Floats, kLevels>& next,
                         Steps& from) {
  std::array<Ints, kLevels> at_level;
  // From below or the same, then from above.
  Floats least = Floats{} + kNever;
  Ints at{};
  for (std::size_t l = 0; l < kLevels; ++l) {
    const Ints less = best[l] < least;
    least = less ? best[l] : least;
    at = less ? Ints{} + static_cast<std::int32_t>(l) : at;
    next[l] = least + 1;
    at_level[l] = at;
    least += 2;
  }
  least = Floats{} + kNever;
  for (std::size_t l = kLevels; l-- > 0;) {
    const Ints better = least < next[l];
    next[l] = better ? least : next[l];
    at_level[l] = better ? at : at_level[l];
    const Ints less = best[l] < least;
    least = less ? best[l] : least;
    at = less ? Ints{} + static_cast<std::int32_t>(l) : at;
    least += 2;
  }
  for (std::size_t i = 0; i < from.size(); ++i)
    from[i] =
        at_level[4 * i] | at_level[4 * i + 1] << 8 | at_level[4 * i + 2] << 16 | at_level[4 * i + 3] << 24;
}

/// The way through the levels on which they and the symbols together take the fewest bits.
RELIEVO_INLINE void levels_body(const std::uint32_t* counts, std::size_t symbols, Levels* out) {
  Floats total{};
  Ints used{};
  for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t) {
    const std::uint32_t* of = counts + static_cast<std::size_t>(t) * symbols;
    std::uint64_t sum = 0;
    for (std::size_t s = 0; s < symbols; ++s) {
      sum += of[s];
      if (of[s] > 0) used[t] = static_cast<std::int32_t>(s) + 1;
    }
    total[t] = static_cast<float>(sum);
  }
  std::int32_t most_used = 0;
  for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t) most_used = std::max(most_used, used[t]);
  const auto& shares = share_costs();
  std::array<Steps, kMostSymbols> from;
  std::array<Floats, kLevels> best{}, next;
  for (std::int32_t s = 0; s < most_used; ++s) {
    const Ints goes_on = used > s;
    if (s > 0) {
      step(best, next, from[static_cast<std::size_t>(s)]);
      for (std::size_t l = 0; l < kLevels; ++l) best[l] = goes_on ? next[l] : best[l];
    }
    Floats count;
    for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t)
      count[t] =
          static_cast<float>(counts[static_cast<std::size_t>(t) * symbols + static_cast<std::size_t>(s)]);
    for (std::size_t l = 1; l < kLevels; ++l) {
      const Floats cost = total * shares[l] - 0.5F * count * static_cast<float>(l - 1);
      best[l] = goes_on ? best[l] + cost : best[l];
    }
    best[0] = (count > 0) & goes_on ? Floats{} + kNever : best[0];
  }
  for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t) {
    Levels& levels = out[t] = {};
    std::size_t level = 0;
    for (std::size_t l = 1; l < kLevels; ++l)
      if (best[l][t] < best[level][t]) level = l;
    for (auto s = static_cast<std::size_t>(used[t]); s-- > 0;) {
      levels[s] = static_cast<std::uint8_t>(level);
      if (s > 0) level = static_cast<std::size_t>(from[s][level / 4][t] >> 8 * (level % 4) & 255);
    }
  }
}

void levels_portable(const std::uint32_t* counts, std::size_t symbols, Levels* out) {
  levels_body(counts, symbols, out);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void levels_avx2(const std::uint32_t* counts, std::size_t symbols, Levels* out) {
  levels_body(counts, symbols, out);
}
#endif

}  // namespace

const std::vector<Kernels>& all_kernels() {
#if defined(__x86_64__)
  static const auto kernels = variants(Kernels{"portable", encode_portable, levels_portable},
                                       Kernels{"avx2", encode_avx2, levels_avx2});
#else
  static const auto kernels = variants(Kernels{"portable", encode_portable, levels_portable});
#endif
  return kernels;
}

const Kernels& kernels() {
  return all_kernels().back();
}

}  // namespace relievo::rans
