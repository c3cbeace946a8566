// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_predict.h"

#include <algorithm>
#include <cstring>

#include "base/variants.h"
#include "codec/grid_avx2.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"

namespace relievo {
namespace {

#define RELIEVO_INLINE [[gnu::always_inline]] inline

// Eight places at once; a processor with narrower registers takes several for them.
using Ints = std::int32_t __attribute__((vector_size(32)));  // as a mask: 0 or -1
using Unsigned = std::uint32_t __attribute__((vector_size(32)));
using Shorts = std::uint16_t __attribute__((vector_size(16)));
using Octets = std::uint8_t __attribute__((vector_size(8)));

template <typename Vector, typename T>
RELIEVO_INLINE void load(const T* from, Vector& to) {
  std::memcpy(&to, from, sizeof to);
}
template <typename Vector, typename T>
RELIEVO_INLINE void store(const Vector& from, T* to) {
  std::memcpy(to, &from, sizeof from);
}
RELIEVO_INLINE void load_octets(const std::uint8_t* from, Ints& to) {
  Octets octets;
  load(from, octets);
  to = __builtin_convertvector(octets, Ints);
}
RELIEVO_INLINE void store_octets(const Ints& from, std::uint8_t* to) {
  store(__builtin_convertvector(from, Octets), to);
}

/// The difference of two places, none where it is out of bounds. Absent places are far from all others.
RELIEVO_INLINE std::int32_t within(std::int32_t a, std::int32_t b, std::int32_t limit) {
  const std::int32_t d = a - b;
  return d <= limit && d >= -limit ? d : 0;
}

RELIEVO_INLINE void predict_body(const GridRows& rows, const GridModel& model, int count,
                                 std::int32_t* __restrict expected) {
  const std::int32_t limit = model.limit;
  const int places = (count + 7) / 8 * 8;
  for (int b = 0; b < places; ++b) {
    const std::int32_t up = rows.up1[b];
    const std::int32_t d1 = within(up, rows.up2[b], limit);
    const std::int32_t d2 = within(rows.up2[b], rows.up3[b], limit);
    const std::int32_t d3 = within(rows.up3[b], rows.up4[b], limit);
    expected[b] = up + ((model.slope1 * d1 + model.slope2 * d2 + model.slope3 * d3 + 128) >> 8);
  }
  if (rows.key == nullptr) return;
  for (int b = 0; b < places; b += 8) {
    Ints up, key_up, key, alone;
    load(rows.up1 + b, up);
    load(rows.key_up + b, key_up);
    load(rows.key + b, key);
    load(expected + b, alone);
    const Ints change = up - key_up;
    const Ints d = key - alone;
    const Ints near = (change <= limit) & (change >= -limit) & (d <= limit) & (d >= -limit);
    // Of absent places the products would overflow.
    const Ints more = (model.key * (near & d) + model.key_change * (near & change) + 128) >> 8;
    store(alone + (near & more), expected + b);
  }
}

RELIEVO_INLINE void contexts_body(const std::uint8_t* sizes, const std::int32_t* up1, int count,
                                  std::uint8_t* __restrict out) {
  const int places = (count + 7) / 8 * 8;
  for (int b = 0; b < places; ++b) {
    const auto t = static_cast<std::uint8_t>(sizes[b - 1] + 2 * sizes[b] + sizes[b + 1]);
    out[b] = static_cast<std::uint8_t>((t >= 1) + (t >= 2) + (t >= 4) + (t >= 8) + (t >= 16) + (t >= 32));
  }
  for (int b = 0; b < places; ++b) out[b] = up1[b] == StripeGrid::kAbsent ? kAloneTable : out[b];
}

RELIEVO_INLINE void residuals_body(const GridResiduals& line, int count) {
  for (int b = 0; b < count; b += 8) {
    Ints columns, expected, up1, tables, sizes;
    load(line.columns + b, columns);
    load(line.expected + b, expected);
    load(line.up1 + b, up1);
    load_octets(line.tables + b, tables);
    load_octets(line.sizes + b, sizes);
    const Ints alone = up1 == StripeGrid::kAbsent;
    if (line.tolerance != nullptr) {
      Ints tolerance;
      load_octets(line.tolerance + b, tolerance);
      const Ints off = columns - expected;
      const Ints near = ~alone & (off <= tolerance) & (off >= -tolerance);
      columns = near ? expected : columns;
      store(columns, line.columns + b);
    }
    const Ints d = columns - expected;
    const Ints negative = d >> 31;
    const Ints folded = reinterpret_cast<Ints>(reinterpret_cast<Unsigned>(d) << 1) ^ negative;
    const Ints absent = columns == StripeGrid::kAbsent;
    const Ints by_itself = alone | (folded < 0) | (folded >= kDirectSymbols);
    const Ints done = ~(absent | by_itself);
    store_octets((absent & int{kNoVertex}) | (~absent & by_itself & int{kByItself}), line.kinds + b);
    store_octets(done ? (d ^ negative) - negative : sizes, line.sizes + b);  // below the largest
    // Unsigned: of places without a vertex it may be anything.
    const Unsigned codes =
        reinterpret_cast<Unsigned>(tables * rans::kMostSymbols) + reinterpret_cast<Unsigned>(folded);
    store(__builtin_convertvector(codes, Shorts), line.codes + b);
  }
}

// Each is written, and kept by what comes behind it.
RELIEVO_INLINE std::uint16_t* pack_body(const std::uint16_t* codes, const std::uint8_t* kinds, int count,
                                        std::uint16_t* to) {
  for (int b = 0; b < (count + 7) / 8 * 8; ++b) {
    *to = codes[b];
    to += kinds[b] == kDone ? 1 : 0;
  }
  return to;
}

RELIEVO_INLINE std::uint16_t* pack_cells_body(const GridCellBlock* blocks, int count, std::uint16_t first,
                                              std::uint16_t* to) {
  for (const GridCellBlock* block = blocks; block != blocks + count; ++block) {
    *to = block->whole;
    to += block->says_whole;
    for (int i = 0; i < 8; ++i) {
      *to = static_cast<std::uint16_t>(first + (block->codes >> 8 * i & 255));
      to += block->coded >> 8 * i & 1;
    }
  }
  return to;
}

RELIEVO_INLINE bool columns_body(const GridColumns& line, std::int32_t most, int count) {
  Ints unfair{};
  for (int b = 0; b < count; b += 8) {
    Ints there, folded, tables, expected, sizes;
    load_octets(line.there + b, there);
    load_octets(line.symbols + b, folded);
    load_octets(line.tables + b, tables);
    load_octets(line.sizes + b, sizes);
    load(line.expected + b, expected);
    const Ints d = (folded >> 1) ^ -(folded & 1);
    const Ints column = expected + d;
    const Ints absent = there == 0;
    const Ints by_itself = (tables == kAloneTable) | (folded >= kDirectSymbols);
    const Ints done = ~(absent | by_itself);
    const Ints negative = d >> 31;
    store_octets((absent & int{kNoVertex}) | (~absent & by_itself & int{kByItself}), line.kinds + b);
    store(done ? column : Ints{} + StripeGrid::kAbsent, line.columns + b);
    store_octets(done ? (d ^ negative) - negative : sizes, line.sizes + b);
    unfair |= done & ((column > most) | (column < -most));
  }
  std::int32_t any = 0;
  for (int i = 0; i < 8; ++i) any |= unfair[i];
  return any == 0;
}

RELIEVO_INLINE void there_body(const std::int32_t* columns, int count, std::uint8_t* __restrict out) {
  for (int b = 0; b < (count + 7) / 8 * 8; ++b) out[b] = columns[b] != StripeGrid::kAbsent;
}

/// Of so few places that no sum overflows: limits are 2^12 at most.
constexpr int kPlacesOfASum = 120;

RELIEVO_INLINE void slopes_of(const std::int32_t* here, const GridRows& rows, int begin, int end,
                              std::int32_t limit, GridSlopes& sums) {
  std::int32_t s00 = 0, s01 = 0, s02 = 0, s11 = 0, s12 = 0, s22 = 0, s0y = 0, s1y = 0, s2y = 0;
  const auto is_near = [limit](std::int32_t d) __attribute__((always_inline)) {
    return static_cast<std::int32_t>(d <= limit) & static_cast<std::int32_t>(d >= -limit);
  };
  for (int b = begin; b < end; ++b) {
    const std::int32_t y = here[b] - rows.up1[b], x0 = rows.up1[b] - rows.up2[b];
    const std::int32_t x1 = rows.up2[b] - rows.up3[b], x2 = rows.up3[b] - rows.up4[b];
    // Absent places are far from all others; between two of them there is nothing to learn.
    const std::int32_t learns = static_cast<std::int32_t>(here[b] != StripeGrid::kAbsent) & is_near(y) &
                                is_near(x0) & is_near(x1) & is_near(x2);
    const std::int32_t mask = -learns;
    const std::int32_t m0 = x0 & mask, m1 = x1 & mask, m2 = x2 & mask, my = y & mask;
    s00 += m0 * m0;
    s01 += m0 * m1;
    s02 += m0 * m2;
    s11 += m1 * m1;
    s12 += m1 * m2;
    s22 += m2 * m2;
    s0y += m0 * my;
    s1y += m1 * my;
    s2y += m2 * my;
  }
  sums.x0x0 += s00;
  sums.x0x1 += s01;
  sums.x0x2 += s02;
  sums.x1x1 += s11;
  sums.x1x2 += s12;
  sums.x2x2 += s22;
  sums.x0y += s0y;
  sums.x1y += s1y;
  sums.x2y += s2y;
}

RELIEVO_INLINE void slopes_body(const std::int32_t* here, const GridRows& rows, std::int32_t limit, int count,
                                GridSlopes& sums) {
  for (int b = 0; b < count; b += kPlacesOfASum)
    slopes_of(here, rows, b, std::min(b + kPlacesOfASum, count), limit, sums);
}

RELIEVO_INLINE void diagonals_body(const std::int32_t* __restrict above, const std::int32_t* __restrict below,
                                   std::int32_t spacing, int count, std::uint8_t* __restrict cells) {
  for (int b = 0; b < count; ++b) {
    const bool straight = straight_diagonal(above[b], below[b], below[b + 1], above[b + 1], spacing);
    const std::uint8_t both = straight ? grid_cell::kStraight : grid_cell::kTurned;
    cells[b] = cells[b] == kBothTriangles ? both : cells[b];
  }
}

#define RELIEVO_KERNELS(set, attributes, contexts_of, residuals_of, pack_of, pack_cells_of, columns_of,      \
                        there_of)                                                                            \
  struct set {                                                                                               \
    attributes static void predict(const GridRows& rows, const GridModel& model, int count,                  \
                                   std::int32_t* expected) {                                                 \
      predict_body(rows, model, count, expected);                                                            \
    }                                                                                                        \
    attributes static void contexts(const std::uint8_t* sizes, const std::int32_t* up1, int count,           \
                                    std::uint8_t* out) {                                                     \
      contexts_of(sizes, up1, count, out);                                                                   \
    }                                                                                                        \
    attributes static void residuals(const GridResiduals& line, int count) { residuals_of(line, count); }    \
    attributes static std::uint16_t* pack(const std::uint16_t* codes, const std::uint8_t* kinds, int count,  \
                                          std::uint16_t* to) {                                               \
      return pack_of(codes, kinds, count, to);                                                               \
    }                                                                                                        \
    attributes static std::uint16_t* pack_cells(const GridCellBlock* blocks, int count, std::uint16_t first, \
                                                std::uint16_t* to) {                                         \
      return pack_cells_of(blocks, count, first, to);                                                        \
    }                                                                                                        \
    attributes static bool columns(const GridColumns& line, std::int32_t most, int count) {                  \
      return columns_of(line, most, count);                                                                  \
    }                                                                                                        \
    attributes static void there(const std::int32_t* columns, int count, std::uint8_t* out) {                \
      there_of(columns, count, out);                                                                         \
    }                                                                                                        \
    attributes static void slopes(const std::int32_t* here, const GridRows& rows, std::int32_t limit,        \
                                  int count, GridSlopes& sums) {                                             \
      slopes_body(here, rows, limit, count, sums);                                                           \
    }                                                                                                        \
    attributes static void diagonals(const std::int32_t* above, const std::int32_t* below,                   \
                                     std::int32_t spacing, int count, std::uint8_t* cells) {                 \
      diagonals_body(above, below, spacing, count, cells);                                                   \
    }                                                                                                        \
    static GridKernels table(const char* name) {                                                             \
      return {name, predict, contexts, residuals, pack, pack_cells, columns, there, slopes, diagonals};      \
    }                                                                                                        \
  }

RELIEVO_KERNELS(Portable, , contexts_body, residuals_body, pack_body, pack_cells_body, columns_body,
                there_body);
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]], avx2::contexts, avx2::residuals, avx2::pack, avx2::pack_cells,
                avx2::columns, avx2::there);
#endif

}  // namespace

const std::vector<GridKernels>& all_grid_kernels() {
#if defined(__x86_64__)
  static const auto kernels = variants(Portable::table("portable"), Avx2::table("avx2"));
#else
  static const auto kernels = variants(Portable::table("portable"));
#endif
  return kernels;
}

const GridKernels& grid_kernels() {
  return all_grid_kernels().back();
}

}  // namespace relievo
