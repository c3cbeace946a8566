// SPDX-License-Identifier: Apache-2.0
// What encoder and decoder of the stripe grid share: which alphabets there are, and how numbers become
// symbols. codec/FORMAT.md, "Geometry codec 2", has the same in words.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <utility>

#include "codec/grid_predict.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"

namespace relievo::grid {

// Alphabets of the control stream, by the numbers of their tables. All but the cells' have two symbols.
constexpr int kPlaceTables = 32;             // by the places around: left, above, beside those, key
constexpr int kBlockTable = kPlaceTables;    // eight places as those around, which are: none, there
constexpr int kCellTable = kBlockTable + 2;  // by corners, and by the cells left and above
constexpr int kCellTables = 8;
constexpr int kCellBlockTable = kCellTable + kCellTables;  // eight whole cells
constexpr int kMarkTable = kCellBlockTable + 1;            // interpolated, by the marks above and left
constexpr int kControlTables = kMarkTable + 4;
constexpr int kCellSymbols = 6;
constexpr int kControlSymbols = 8;  // room for each of them

constexpr int kResidualTables = 8;      // by the sizes above; the last where nothing is above
constexpr std::uint8_t kFirstSize = 1;  // what is taken for the sizes above a slice

constexpr int kSigmaTables = 5;
constexpr int kFirstSigma = 32;  // code, before the first vertex of a slice
constexpr int kMostSigma = 63;

constexpr std::int32_t kMostPixels = 1 << 14;  // of a column, on both sides

// Residuals: zigzag, one symbol each up to kDirect, then by the number of bits, which follow in the slice's
// raw bits.
constexpr std::uint32_t kDirect = kDirectSymbols;
constexpr std::uint32_t kFirstEscape = 8;

inline std::uint32_t zigzag(std::int32_t d) {
  return static_cast<std::uint32_t>(d) << 1 ^ static_cast<std::uint32_t>(d >> 31);
}
inline std::int32_t unzigzag(std::uint32_t z) {
  return static_cast<std::int32_t>(z >> 1 ^ (~(z & 1U) + 1U));
}

/// Of a number below 2^26; the caller writes `count` low bits of `rest`.
struct Symbol {
  std::uint8_t symbol;
  std::uint8_t count;
  std::uint32_t rest;
};
inline Symbol symbol_of(std::uint32_t z) {
  if (z < kDirect) return {static_cast<std::uint8_t>(z), 0, 0};
  const std::uint32_t v = z - kDirect + kFirstEscape;
  const int bits = std::bit_width(v) - 1;
  return {static_cast<std::uint8_t>(kDirect + static_cast<std::uint32_t>(bits) - 3),
          static_cast<std::uint8_t>(bits), v - (1U << bits)};
}
inline std::uint32_t number_of(std::uint8_t symbol, rans::BitReader& raw) {
  if (symbol < kDirect) return symbol;
  const int bits = symbol - static_cast<int>(kDirect) + 3;  // at most 26
  return (1U << bits) + raw.get(bits) - kFirstEscape + kDirect;
}

/// Eight places or cells at once, a byte each.
inline std::uint64_t load8(const std::uint8_t* from) {
  std::uint64_t value;
  std::memcpy(&value, from, sizeof value);
  return value;
}
constexpr std::uint64_t kOnes = 0x0101010101010101U;

/// Whether a block of eight places is likely to be all as those around it: which is what it is then, 0 or 1;
/// -1: not.
inline int uniform_places(const std::uint8_t* left, const std::uint8_t* above, const std::uint8_t* key,
                          int b) {
  const std::uint8_t v = left[b - 1];
  const std::uint64_t all = v * kOnes;
  const bool same = load8(above + b) == all && above[b - 1] == v && above[b + 8] == v &&
                    (key == nullptr || load8(key + b) == all);
  return same ? v : -1;
}
/// A place's context is whether there is a vertex left of it and what the bits say that are around it else,
/// of eight places a byte each.
inline std::uint64_t place_contexts_around(const std::uint8_t* above, const std::uint8_t* key, int b) {
  return load8(above + b) << 1 | load8(above + b + 1) << 2 | load8(above + b - 1) << 3 |
         (key != nullptr ? load8(key + b) << 4 : 0);
}

/// A vertex of a line; at first none.
struct Last {
  std::int32_t column = 0;
  int boundary = 0;
};
/// The last vertex on a line before place b.
inline Last last_before(const std::int32_t* here, int b) {
  while (--b >= 0)
    if (here[b] != StripeGrid::kAbsent) return {here[b], b};
  return {};
}

/// Where no vertex is above: from the key frame, the left or the right above, or else the last one coded.
inline std::int32_t expected_alone(const std::int32_t* here, const std::int32_t* above,
                                   const std::int32_t* key, int b, const Last& last, std::int32_t spacing) {
  constexpr std::int32_t kAbsent = StripeGrid::kAbsent;
  if (key != nullptr && key[b] != kAbsent) return key[b];
  if (here[b - 1] != kAbsent)
    return here[b - 2] != kAbsent ? 2 * here[b - 1] - here[b - 2] : here[b - 1] + spacing;
  if (above[b + 1] != kAbsent) return above[b + 1] - spacing;
  return last.column + (b - last.boundary) * spacing;
}

/// Of a cell with both triangles; which diagonal they share follows from the columns.
constexpr std::uint8_t kBoth = kBothTriangles;

/// Whether eight cells are all likely to hold two triangles: all corners are there, and left and all above
/// are good.
inline bool uniform_cells(const std::uint8_t* good_here, const std::uint8_t* good_above,
                          const std::uint8_t* above, const std::uint8_t* below, int b) {
  return good_here[b - 1] != 0 && load8(good_above + b) == kOnes && load8(above + b) == kOnes &&
         load8(below + b) == kOnes && above[b + 8] != 0 && below[b + 8] != 0;
}

/// Which corners of a cell are there, a bit each.
inline unsigned corners_there(const std::uint8_t* above, const std::uint8_t* below, int b) {
  return static_cast<unsigned>(above[b] | below[b] << 1 | below[b + 1] << 2 | above[b + 1] << 3);
}
constexpr std::array<std::uint8_t, 16> kCornerCounts{0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};
/// Of cells with three: the one that is not there.
inline int missing_of(unsigned corners) {
  return std::countr_zero(~corners & 15U);
}

/// What a cell of so many corners (3 or 4) holds, as a symbol: 0 as many triangles as there can be, 1 none,
/// 2 + c one, the one without corner c.
inline int cell_symbol(std::uint8_t cell, int corners) {
  if (cell == 0) return 1;
  if (corners == 3 || cell == grid_cell::kStraight || cell == grid_cell::kTurned) return 0;
  return 2 + std::countr_zero(cell);
}
inline std::uint32_t triangles_of(int symbol, int corners) {
  return symbol == 1 ? 0U : symbol == 0 && corners == 4 ? 2U : 1U;
}
/// cell_symbol() of eight cells at once, a byte each; cells are good that hold as many triangles as there can
/// be. `asked`: 255 for each, 0 behind a line's end. `left`: whether the one before the first is good.
struct EightCells {
  std::uint64_t coded;  // which have three corners or four; all others say nothing here
  std::uint64_t good;
  std::uint64_t codes;  // of symbols, see rans::code_of(), from kCellTable's first one on
  std::uint32_t triangles;
};
inline EightCells eight_cells(const std::uint8_t* cells, const std::uint8_t* above, const std::uint8_t* below,
                              std::uint64_t asked, std::uint64_t good_above, std::uint8_t left) {
  constexpr std::uint64_t kMany = 15 * kOnes;
  const std::uint64_t corners = load8(above) + load8(above + 1) + load8(below) + load8(below + 1);
  const std::uint64_t four = corners >> 2 & kOnes;
  const std::uint64_t coded = (corners + kOnes) >> 2 & kOnes & asked;
  const std::uint64_t cell = load8(cells);
  const std::uint64_t any = (cell + kMany) >> 4 & coded;
  static_assert(grid_cell::kStraight == 0b1010 && grid_cell::kTurned == 0b0101);
  const std::uint64_t opposite = cell & cell >> 2;
  const std::uint64_t one = any & four & ~(opposite | opposite >> 1);
  const std::uint64_t which =
      ((cell >> 1 | cell >> 3) & kOnes) + ((cell >> 2 | cell >> 3) & kOnes) * 2;  // of one's corners
  const std::uint64_t symbols = (coded ^ any) | (one * 0xff & (2 * kOnes + which));
  const std::uint64_t good = any ^ one;
  const std::uint64_t tables = 4 * four + 2 * (good << 8 | left) + good_above;
  static_assert(kCellTables * kControlSymbols <= 256);
  return {coded, good, tables * kControlSymbols + symbols,
          static_cast<std::uint32_t>((any + (good & four)) * kOnes >> 56)};
}

/// The reverse; `lack`: the corner that is not there, where there are three.
inline std::uint8_t cell_of(int symbol, int corners, int lack) {
  if (symbol == 1) return 0;
  if (corners == 3) return static_cast<std::uint8_t>(1U << lack);
  return symbol == 0 ? kBoth : static_cast<std::uint8_t>(1U << (symbol - 2));
}

}  // namespace relievo::grid
