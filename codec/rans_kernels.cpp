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
  /// The next kAtOnce symbols, if so many are left; all others, and the row's first one, are left to
  /// finish().
  static constexpr int kAtOnce = 4;
  RELIEVO_INLINE void put() {
    if (code_ - begin_ < kAtOnce) return;
    code_ -= kAtOnce;
#pragma GCC unroll kAtOnce
    for (int i = kAtOnce; i-- > 0;) put_before(symbols_ + code_[i]);
  }
  RELIEVO_INLINE void finish(StreamJob& job) {
    while (code_ != begin_) put_before(symbols_ + *--code_);
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
    quotient_ = x_ * symbol_->reciprocal >> symbol_->wide_shift;
  }
  RELIEVO_INLINE void put_before(const EncoderSymbol* next) {
    const std::uint64_t complement = symbol_->complement, reciprocal = next->reciprocal;
    const std::uint64_t sum = x_ + symbol_->bias;
    std::uint64_t ahead = complement * reciprocal;
    asm("" : "+r"(ahead));  // or else compilers make one product of both
    const std::uint64_t divided = sum * reciprocal + quotient_ * ahead;
    x_ = sum + quotient_ * complement;
    quotient_ = divided >> next->wide_shift;
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
  static_assert(offsetof(EncoderSymbol, limit) == 0 && offsetof(EncoderSymbol, shift) == 15);
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
  const __m128i q = _mm_srlv_epi32(product, _mm_srli_epi32(both, 24));
  const __m128i complement = _mm_and_si128(both, _mm_set1_epi32(0xffff));
  return _mm_add_epi32(_mm_add_epi32(x, bias), _mm_mullo_epi32(q, complement));
}

/// Of a lane that has no symbol: its state stays.
constexpr EncoderSymbol kNothing{.limit = 1U << 31};

[[gnu::target("avx2")]] void encode_avx2(StreamJob& lanes, StreamJob& single) {
  __m128i states = load(lanes.states.data());
  std::uint16_t* to = lanes.to;
  SingleLane beside(single);
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
      beside.put();
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

// A table each. Bits are counted in whole parts of one, since each step waits for the one before and those of
// floats take twice as long. Of more than kMostCounted symbols all are counted as fewer: no sum is kNever
// then.
using Ints = std::int32_t __attribute__((vector_size(32)));
using Floats = float __attribute__((vector_size(32)));
constexpr std::int32_t kBit = 64;
constexpr std::uint32_t kMostCounted = 1U << 19;
constexpr std::size_t kLevels = kLargestLevel + 1;
constexpr std::int32_t kNever = 1 << 30;

/// How the cheapest ways lead to a symbol's levels, a bit a level.
struct Ways {
  Ints up;             // the way from below begins at this level
  Ints down;           // that from above does
  Ints is_from_above;  // which of the two it is
};

/// What each level of a symbol takes with all symbols before it, from the same of the symbol before: as
/// write_levels() has it a level up takes two bits, a level down too, and none takes one. The symbol's own
/// bits are a level's share of all others less half a bit a level each time that it comes.
RELIEVO_INLINE void step(const std::array<Ints, kLevels>& shares, const Ints& count,
                         std::array<Ints, kLevels>& best, Ways& ways) {
  constexpr int kHighest = kLargestLevel;
  // The least of a way up or down grows by two bits a level. Less what it has grown by, it only ever falls:
  // one step of those that wait for each other, not three.
  std::array<Ints, kLevels> from_below;
  Ints up = Ints{} + 1, down{}, is_from_above{};
  Ints least = Ints{} + kNever;
#pragma GCC unroll 24
  for (int l = 0; l <= kHighest; ++l) {
    const auto at = static_cast<std::size_t>(l);
    const std::int32_t grown = 2 * kBit * l;
    const Ints here = best[at] - grown;
    up |= (here < least) & (1 << l);
    least = here < least ? here : least;
    from_below[at] = least + (grown + kBit);
  }
  least = Ints{} + kNever;
  const Ints half = count * (kBit / 2);
  Ints gain = half * (kHighest - 1);
#pragma GCC unroll 24
  for (int l = kHighest; l >= 0; --l) {
    const auto at = static_cast<std::size_t>(l);
    const std::int32_t grown = 2 * kBit * (kHighest - l);
    const Ints from_above = least + grown;
    const Ints better = from_above < from_below[at];
    is_from_above |= better & (1 << l);
    const Ints way = better ? from_above : from_below[at];
    const Ints here = best[at] - grown;
    down |= (here < least) & (1 << l);
    least = (here < least ? here : least);
    best[at] = way + (l > 0 ? shares[at] - gain : Ints{});
    gain -= half;
  }
  best[0] = count > 0 ? Ints{} + kNever : best[0];
  ways = {up, down, is_from_above};
}

/// The level before `level` on a table's way.
std::int32_t level_before(const Ways& ways, int table, std::int32_t level) {
  const auto up = static_cast<std::uint32_t>(ways.up[table]);
  const auto down = static_cast<std::uint32_t>(ways.down[table]);
  if ((ways.is_from_above[table] >> level & 1) != 0) return level + 1 + std::countr_zero(down >> (level + 1));
  return std::bit_width(up & ((2U << level) - 1)) - 1;
}

/// What is counted of some tables.
struct Counted {
  std::array<Ints, kMostSymbols> counts;
  Ints totals{};
  Ints used{};                                    // symbols up to the last one that comes
  std::array<std::uint8_t, kMostSymbols> ends{};  // 1 where it is the last one of a table
  std::int32_t most_used = 0;
};

RELIEVO_INLINE void count_tables(const std::uint32_t* counts, std::size_t symbols, Counted& out) {
  for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t) {
    const std::uint32_t* of = counts + static_cast<std::size_t>(t) * symbols;
    std::uint64_t total = 0;
    for (std::size_t s = 0; s < symbols; ++s) total += of[s];
    int shift = 0;
    while (total >> shift > kMostCounted) ++shift;
    std::int32_t used = 0;
    for (std::size_t s = 0; s < symbols; ++s) {
      out.counts[s][t] = static_cast<std::int32_t>(of[s] > 0 ? std::max(of[s] >> shift, 1U) : 0U);
      used = of[s] > 0 ? static_cast<std::int32_t>(s) + 1 : used;
    }
    out.totals[t] = static_cast<std::int32_t>(total >> shift);
    out.used[t] = used;
    if (used > 0) out.ends[static_cast<std::size_t>(used - 1)] = 1;
    out.most_used = std::max(out.most_used, used);
  }
}

/// The way through the levels on which they and the symbols together take the fewest bits.
RELIEVO_INLINE void levels_body(const std::uint32_t* counts, std::size_t symbols, Levels* out) {
  Counted counted;
  count_tables(counts, symbols, counted);
  std::array<Ints, kLevels> shares, best{};
  const Floats totals = __builtin_convertvector(counted.totals, Floats) * kBit;
  for (std::size_t l = 0; l < kLevels; ++l)
    shares[l] = __builtin_convertvector(totals * share_costs()[l], Ints);
  std::array<Ways, kMostSymbols> ways;
  Ints level{};  // of each table's last symbol
  for (std::int32_t s = 0; s < counted.most_used; ++s) {
    const auto at = static_cast<std::size_t>(s);
    step(shares, counted.counts[at], best, ways[at]);
    if (counted.ends[at] == 0) continue;
    const Ints ends = counted.used == s + 1;
    Ints least = best[0];
    for (std::size_t l = 1; l < kLevels; ++l) {
      const Ints less = ends & (best[l] < least);
      least = less ? best[l] : least;
      level = less ? Ints{} + static_cast<std::int32_t>(l) : level;
    }
  }
  for (std::size_t t = 0; t < kTablesAtOnce; ++t) out[t] = {};
  // Table by table each step would wait for the one before.
  for (std::int32_t s = counted.most_used; s-- > 0;) {
    for (int t = 0; t < static_cast<int>(kTablesAtOnce); ++t) {
      if (counted.used[t] <= s) continue;
      out[t][static_cast<std::size_t>(s)] = static_cast<std::uint8_t>(level[t]);
      if (s > 0) level[t] = level_before(ways[static_cast<std::size_t>(s)], t, level[t]);
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
