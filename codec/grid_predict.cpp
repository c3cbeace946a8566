// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_predict.h"

#include "base/variants.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"

namespace relievo {
namespace {

#define RELIEVO_INLINE [[gnu::always_inline]] inline

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
  for (int b = 0; b < places; ++b) {
    const std::int32_t change = rows.up1[b] - rows.key_up[b];
    const std::int32_t d = rows.key[b] - expected[b];
    const bool near = change <= limit && change >= -limit && d <= limit && d >= -limit;
    // Of absent places the products would overflow.
    const std::int32_t more =
        (model.key * (near ? d : 0) + model.key_change * (near ? change : 0) + 128) >> 8;
    expected[b] += near ? more : 0;
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
  const std::int32_t* __restrict up1 = line.up1;
  const std::int32_t* __restrict expected = line.expected;
  std::int32_t* __restrict columns = line.columns;
  std::uint8_t* __restrict sizes = line.sizes;
  std::uint8_t* __restrict kinds = line.kinds;
  std::uint16_t* __restrict codes = line.codes;
  const std::uint8_t* __restrict tables = line.tables;
  const int places = (count + 7) / 8 * 8;
  if (line.tolerance != nullptr) {
    for (int b = 0; b < places; ++b) {
      const std::int32_t d = columns[b] - expected[b];
      const std::int32_t tolerance = line.tolerance[b];
      const bool near = (up1[b] != StripeGrid::kAbsent) & (d <= tolerance) & (d >= -tolerance);
      columns[b] = near ? expected[b] : columns[b];
    }
  }
  for (int b = 0; b < places; ++b) {
    const std::int32_t d = columns[b] - expected[b];
    const std::int32_t size = d < 0 ? -d : d;
    const std::uint32_t folded = static_cast<std::uint32_t>(d) << 1 ^ static_cast<std::uint32_t>(d >> 31);
    const bool absent = columns[b] == StripeGrid::kAbsent;
    const bool by_itself = (up1[b] == StripeGrid::kAbsent) | (folded >= kDirectSymbols);
    const int kind = absent ? kNoVertex : by_itself ? kByItself : kDone;
    kinds[b] = static_cast<std::uint8_t>(kind);
    sizes[b] = static_cast<std::uint8_t>(kind == kDone ? size : sizes[b]);  // a symbol's is below the largest
    codes[b] = static_cast<std::uint16_t>(tables[b] * rans::kMostSymbols + static_cast<std::int32_t>(folded));
  }
}

RELIEVO_INLINE bool columns_body(const GridColumns& line, std::int32_t most, int count) {
  const std::uint8_t* __restrict there = line.there;
  const std::uint8_t* __restrict symbols = line.symbols;
  const std::uint8_t* __restrict tables = line.tables;
  const std::int32_t* __restrict expected = line.expected;
  std::int32_t* __restrict columns = line.columns;
  std::uint8_t* __restrict sizes = line.sizes;
  std::uint8_t* __restrict kinds = line.kinds;
  const int places = (count + 7) / 8 * 8;
  std::int32_t unfair = 0;
  for (int b = 0; b < places; ++b) {
    const std::int32_t folded = symbols[b];
    const std::int32_t d = folded >> 1 ^ -(folded & 1);
    const std::int32_t column = expected[b] + d;
    const bool by_itself = (tables[b] == kAloneTable) | (folded >= kDirectSymbols);
    const int kind = there[b] == 0 ? kNoVertex : by_itself ? kByItself : kDone;
    kinds[b] = static_cast<std::uint8_t>(kind);
    columns[b] = kind == kDone ? column : StripeGrid::kAbsent;
    sizes[b] = static_cast<std::uint8_t>(kind == kDone ? (d < 0 ? -d : d) : sizes[b]);
    unfair |= kind == kDone && (column > most || column < -most) ? 1 : 0;
  }
  return unfair == 0;
}

RELIEVO_INLINE void diagonals_body(const std::int32_t* __restrict above, const std::int32_t* __restrict below,
                                   std::int32_t spacing, int count, std::uint8_t* __restrict cells) {
  for (int b = 0; b < count; ++b) {
    const bool straight = straight_diagonal(above[b], below[b], below[b + 1], above[b + 1], spacing);
    const std::uint8_t both = straight ? grid_cell::kStraight : grid_cell::kTurned;
    cells[b] = cells[b] == kBothTriangles ? both : cells[b];
  }
}

#define RELIEVO_KERNELS(set, attributes)                                                                    \
  struct set {                                                                                              \
    attributes static void predict(const GridRows& rows, const GridModel& model, int count,                 \
                                   std::int32_t* expected) {                                                \
      predict_body(rows, model, count, expected);                                                           \
    }                                                                                                       \
    attributes static void contexts(const std::uint8_t* sizes, const std::int32_t* up1, int count,          \
                                    std::uint8_t* out) {                                                    \
      contexts_body(sizes, up1, count, out);                                                                \
    }                                                                                                       \
    attributes static void residuals(const GridResiduals& line, int count) { residuals_body(line, count); } \
    attributes static bool columns(const GridColumns& line, std::int32_t most, int count) {                 \
      return columns_body(line, most, count);                                                               \
    }                                                                                                       \
    attributes static void diagonals(const std::int32_t* above, const std::int32_t* below,                  \
                                     std::int32_t spacing, int count, std::uint8_t* cells) {                \
      diagonals_body(above, below, spacing, count, cells);                                                  \
    }                                                                                                       \
    static GridKernels table(const char* name) {                                                            \
      return {name, predict, contexts, residuals, columns, diagonals};                                      \
    }                                                                                                       \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
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
