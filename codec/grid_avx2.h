// SPDX-License-Identifier: Apache-2.0
// Kernels of the stripe grid by hand for AVX2, where a compiler's own are slow: octets beside columns. What
// they do is said in grid_predict.h.
#pragma once

#if defined(__x86_64__)

#include <immintrin.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "codec/grid_predict.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"

namespace relievo::avx2 {

#define RELIEVO_AVX2 [[gnu::target("avx2")]]

/// Eight octets in the low half.
RELIEVO_AVX2 inline __m128i load_octets(const std::uint8_t* from) {
  return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(from));
}
RELIEVO_AVX2 inline void store_octets(__m128i from, std::uint8_t* to) {
  _mm_storel_epi64(reinterpret_cast<__m128i*>(to), from);
}
RELIEVO_AVX2 inline __m256i load_ints(const std::int32_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
RELIEVO_AVX2 inline void store_ints(__m256i from, std::int32_t* to) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), from);
}
/// Eight numbers of 16 bits; larger ones become the largest.
RELIEVO_AVX2 inline __m128i narrow(__m256i ints) {
  return _mm_packus_epi32(_mm256_castsi256_si128(ints), _mm256_extracti128_si256(ints, 1));
}

/// Which are folded residuals that are their own symbols, in tables that are not kAloneTable.
RELIEVO_AVX2 inline __m128i is_direct(__m128i folded, __m128i tables) {
  const __m128i direct = _mm_cmpeq_epi8(_mm_min_epu8(folded, _mm_set1_epi8(kDirectSymbols - 1)), folded);
  return _mm_andnot_si128(_mm_cmpeq_epi8(tables, _mm_set1_epi8(kAloneTable)), direct);
}
/// GridPlaceKind of places that are done, and of those without a vertex; never both.
RELIEVO_AVX2 inline __m128i kinds_of(__m128i done, __m128i absent) {
  static_assert(kDone == 0 && kNoVertex == 1 && kByItself == 2);
  return _mm_andnot_si128(done, _mm_add_epi8(_mm_set1_epi8(kByItself), absent));
}
/// Of folded residuals.
RELIEVO_AVX2 inline __m128i sizes_of(__m128i folded) {
  return _mm_avg_epu8(folded, _mm_setzero_si128());
}

RELIEVO_AVX2 inline __m256i within_tolerance(const GridResiduals& line, int b, __m256i columns,
                                             __m256i expected) {
  const __m256i tolerance = _mm256_cvtepu8_epi32(load_octets(line.tolerance + b));
  const __m256i off = _mm256_sub_epi32(columns, expected);
  // Differences of places that are not there are far from any tolerance, whether or not they overflow.
  const __m256i far =
      _mm256_or_si256(_mm256_cmpgt_epi32(off, tolerance),
                      _mm256_cmpgt_epi32(_mm256_sub_epi32(_mm256_setzero_si256(), tolerance), off));
  const __m128i tables = load_octets(line.tables + b);
  const __m256i alone = _mm256_cvtepi8_epi32(_mm_cmpeq_epi8(tables, _mm_set1_epi8(kAloneTable)));
  return _mm256_blendv_epi8(expected, columns, _mm256_or_si256(far, alone));
}

/// Folded residuals of eight places; those that are no symbol are the first number above them, absent ones
/// have 255 in it.
RELIEVO_AVX2 inline __m256i folded_residuals(const GridResiduals& line, int b) {
  const __m256i expected = load_ints(line.expected + b);
  __m256i columns = load_ints(line.columns + b);
  if (line.tolerance != nullptr) {
    columns = within_tolerance(line, b, columns, expected);
    store_ints(columns, line.columns + b);
  }
  const __m256i d = _mm256_sub_epi32(columns, expected);
  const __m256i folded = _mm256_xor_si256(_mm256_slli_epi32(d, 1), _mm256_srai_epi32(d, 31));
  const __m256i seen = _mm256_min_epu32(folded, _mm256_set1_epi32(kDirectSymbols));
  const __m256i absent = _mm256_cmpeq_epi32(columns, _mm256_set1_epi32(StripeGrid::kAbsent));
  return _mm256_or_si256(seen, _mm256_srli_epi32(absent, 24));
}

struct Residuals {
  __m128i kinds, sizes;
};
/// `octets`: of folded_residuals().
RELIEVO_AVX2 inline Residuals residuals_of(__m128i octets, __m128i tables, __m128i sizes) {
  const __m128i done = is_direct(octets, tables);
  return {kinds_of(done, _mm_cmpeq_epi8(octets, _mm_set1_epi8(-1))),
          _mm_blendv_epi8(sizes, sizes_of(octets), done)};
}

RELIEVO_AVX2 inline __m128i load16(const void* from) {
  return _mm_loadu_si128(static_cast<const __m128i*>(from));
}
RELIEVO_AVX2 inline void store16(__m128i from, void* to) {
  _mm_storeu_si128(static_cast<__m128i*>(to), from);
}

/// Sixteen numbers of 16 bits in their order, of eight and eight.
RELIEVO_AVX2 inline __m256i narrow(__m256i first, __m256i second) {
  return _mm256_permute4x64_epi64(_mm256_packus_epi32(first, second), 0b11011000);
}

RELIEVO_AVX2 inline void residuals(const GridResiduals& line, int count) {
  int b = 0;
  for (; b + 8 < count; b += 16) {
    const __m256i symbols = narrow(folded_residuals(line, b), folded_residuals(line, b + 8));
    const __m128i octets =
        _mm_packus_epi16(_mm256_castsi256_si128(symbols), _mm256_extracti128_si256(symbols, 1));
    const __m128i tables = load16(line.tables + b);
    const Residuals those = residuals_of(octets, tables, load16(line.sizes + b));
    store16(those.kinds, line.kinds + b);
    store16(those.sizes, line.sizes + b);
    const __m256i first =
        _mm256_mullo_epi16(_mm256_cvtepu8_epi16(tables), _mm256_set1_epi16(rans::kMostSymbols));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(line.codes + b), _mm256_add_epi16(first, symbols));
  }
  if (b >= count) return;
  const __m128i symbols = narrow(folded_residuals(line, b));
  const __m128i tables = load_octets(line.tables + b);
  const Residuals those =
      residuals_of(_mm_packus_epi16(symbols, symbols), tables, load_octets(line.sizes + b));
  store_octets(those.kinds, line.kinds + b);
  store_octets(those.sizes, line.sizes + b);
  const __m128i first = _mm_mullo_epi16(_mm_cvtepu8_epi16(tables), _mm_set1_epi16(rans::kMostSymbols));
  store16(_mm_add_epi16(first, symbols), line.codes + b);
}

/// `left`, `here`, `right`: sizes of sixteen places and of those beside them; `alone`: -1 where nothing is
/// above.
RELIEVO_AVX2 inline __m128i contexts_of(__m128i left, __m128i here, __m128i right, __m128i alone) {
  const __m128i t = _mm_add_epi8(_mm_add_epi8(left, right), _mm_add_epi8(here, here));
  const __m128i small = _mm_setr_epi8(0, 1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4);
  const __m128i below_16 = _mm_shuffle_epi8(small, _mm_min_epu8(t, _mm_set1_epi8(15)));
  const __m128i from_16 = _mm_cmpeq_epi8(_mm_max_epu8(t, _mm_set1_epi8(16)), t);
  const __m128i from_32 = _mm_cmpeq_epi8(_mm_max_epu8(t, _mm_set1_epi8(32)), t);
  const __m128i contexts = _mm_sub_epi8(below_16, _mm_add_epi8(from_16, from_32));
  return _mm_blendv_epi8(contexts, _mm_set1_epi8(kAloneTable), alone);
}

RELIEVO_AVX2 inline void contexts(const std::uint8_t* sizes, const std::int32_t* up1, int count,
                                  std::uint8_t* out) {
  const __m256i kAbsent = _mm256_set1_epi32(StripeGrid::kAbsent);
  int b = 0;
  for (; b + 8 < count; b += 16) {
    const __m256i absent = _mm256_packs_epi32(_mm256_cmpeq_epi32(load_ints(up1 + b), kAbsent),
                                              _mm256_cmpeq_epi32(load_ints(up1 + b + 8), kAbsent));
    const __m256i in_order = _mm256_permute4x64_epi64(absent, 0b11011000);
    const __m128i alone =
        _mm_packs_epi16(_mm256_castsi256_si128(in_order), _mm256_extracti128_si256(in_order, 1));
    store16(contexts_of(load16(sizes + b - 1), load16(sizes + b), load16(sizes + b + 1), alone), out + b);
  }
  if (b >= count) return;
  const __m256i absent = _mm256_cmpeq_epi32(load_ints(up1 + b), kAbsent);
  const __m128i shorts = _mm_packs_epi32(_mm256_castsi256_si128(absent), _mm256_extracti128_si256(absent, 1));
  store_octets(contexts_of(load_octets(sizes + b - 1), load_octets(sizes + b), load_octets(sizes + b + 1),
                           _mm_packs_epi16(shorts, shorts)),
               out + b);
}

/// By which of eight are kept: their numbers, one after the other.
inline constexpr auto kKept = [] {
  std::array<std::array<std::uint8_t, 8>, 256> out{};
  for (unsigned kept = 0; kept < 256; ++kept) {
    std::size_t next = 0;
    for (unsigned i = 0; i < 8; ++i)
      if ((kept >> i & 1U) != 0) out[kept][next++] = static_cast<std::uint8_t>(i);
  }
  return out;
}();

RELIEVO_AVX2 inline std::uint16_t* pack(const std::uint16_t* codes, const std::uint8_t* kinds, int count,
                                        std::uint16_t* to) {
  for (int b = 0; b < count; b += 8) {
    const __m128i done = _mm_cmpeq_epi8(load_octets(kinds + b), _mm_set1_epi8(kDone));
    const unsigned kept = static_cast<unsigned>(_mm_movemask_epi8(done)) & 255U;
    const __m128i number = load_octets(kKept[kept].data());
    const __m128i twice = _mm_unpacklo_epi8(number, number);  // each code's two bytes
    const __m128i bytes = _mm_add_epi8(_mm_add_epi8(twice, twice), _mm_set1_epi16(0x0100));
    const __m128i all = _mm_loadu_si128(reinterpret_cast<const __m128i*>(codes + b));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_shuffle_epi8(all, bytes));
    to += std::popcount(kept);
  }
  return to;
}

RELIEVO_AVX2 inline std::uint16_t* pack_cells(const GridCellBlock* blocks, int count, std::uint16_t first,
                                              std::uint16_t* to) {
  const __m128i base = _mm_set1_epi16(static_cast<std::int16_t>(first));
  for (const GridCellBlock* block = blocks; block != blocks + count; ++block) {
    *to = block->whole;
    to += block->says_whole;
    const __m128i both = _mm_loadu_si128(reinterpret_cast<const __m128i*>(block));
    const unsigned kept = static_cast<unsigned>(_mm_movemask_epi8(_mm_slli_epi16(both, 7))) >> 8;
    const __m128i codes = _mm_shuffle_epi8(both, load_octets(kKept[kept].data()));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_add_epi16(_mm_cvtepu8_epi16(codes), base));
    to += std::popcount(kept);
  }
  return to;
}

RELIEVO_AVX2 inline bool columns(const GridColumns& line, std::int32_t most, int count) {
  const __m256i kAbsent = _mm256_set1_epi32(StripeGrid::kAbsent);
  const __m256i highest = _mm256_set1_epi32(most), lowest = _mm256_set1_epi32(-most);
  __m256i unfair = _mm256_setzero_si256();
  for (int b = 0; b < count; b += 8) {
    const __m128i symbols = load_octets(line.symbols + b);
    const __m128i absent = _mm_cmpeq_epi8(load_octets(line.there + b), _mm_setzero_si128());
    const __m128i done = _mm_andnot_si128(absent, is_direct(symbols, load_octets(line.tables + b)));
    store_octets(kinds_of(done, absent), line.kinds + b);
    store_octets(_mm_blendv_epi8(load_octets(line.sizes + b), sizes_of(symbols), done), line.sizes + b);
    const __m128i half = _mm_and_si128(_mm_srli_epi16(symbols, 1), _mm_set1_epi8(0x7f));
    const __m128i odd = _mm_sub_epi8(_mm_setzero_si128(), _mm_and_si128(symbols, _mm_set1_epi8(1)));
    const __m256i d = _mm256_cvtepi8_epi32(_mm_xor_si128(half, odd));
    const __m256i column = _mm256_add_epi32(load_ints(line.expected + b), d);
    const __m256i is_done = _mm256_cvtepi8_epi32(done);
    const __m256i out =
        _mm256_or_si256(_mm256_cmpgt_epi32(column, highest), _mm256_cmpgt_epi32(lowest, column));
    unfair = _mm256_or_si256(unfair, _mm256_and_si256(is_done, out));
    store_ints(_mm256_blendv_epi8(kAbsent, column, is_done), line.columns + b);
  }
  return _mm256_testz_si256(unfair, unfair) != 0;
}

RELIEVO_AVX2 inline void there(const std::int32_t* columns, int count, std::uint8_t* out) {
  const __m256i kAbsent = _mm256_set1_epi32(StripeGrid::kAbsent);
  for (int b = 0; b < count; b += 8) {
    const __m256i absent = _mm256_cmpeq_epi32(load_ints(columns + b), kAbsent);
    const __m128i shorts =
        _mm_packs_epi32(_mm256_castsi256_si128(absent), _mm256_extracti128_si256(absent, 1));
    store_octets(_mm_add_epi8(_mm_packs_epi16(shorts, shorts), _mm_set1_epi8(1)), out + b);
  }
}

#undef RELIEVO_AVX2

}  // namespace relievo::avx2

#endif
