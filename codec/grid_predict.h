// SPDX-License-Identifier: Apache-2.0
// What a line of the stripe grid is expected to be, from the lines above it and from the key frame. As
// capture/reconstruct/rows.h: one portable implementation and others with the same results.
#pragma once

#include <cstdint>
#include <vector>

namespace relievo {

/// Weights are of 256. A difference beyond `limit` steps, or with a place that is absent, counts as none.
struct GridModel {
  static constexpr int kMostWeight = 1024;
  static constexpr int kMostLimit = 4096;

  std::int16_t slope1 = 205, slope2 = 51,
               slope3 = 0;               // of the differences of the three lines above, nearest first
  std::int16_t key = 0, key_change = 0;  // of key less expected, and of the line above less its key
  std::uint16_t limit = 32;              // steps
  std::int32_t spacing = 0;              // from boundary to boundary, steps
};

/// Places of one boundary range on the lines above, nearest first, in the key frame on this line and the one
/// above; StripeGrid::kAbsent where there is no vertex. Key rows are null in key frames.
struct GridRows {
  const std::int32_t *up1, *up2, *up3, *up4;
  const std::int32_t *key, *key_up;
};

constexpr std::uint8_t kAloneTable = 7;       // of residuals where nothing is above
constexpr std::int32_t kLargestSize = 60;     // of a residual, that is remembered for those below
constexpr std::uint8_t kDirectSymbols = 48;   // folded residuals below are their own symbols
constexpr std::uint8_t kBothTriangles = 255;  // of a cell whose diagonal follows from the columns

/// Which places a kernel did not do, a byte each.
enum GridPlaceKind : std::uint8_t {
  kDone = 0,
  kNoVertex = 1,
  kByItself = 2,  // nothing above, or a residual that is not its own symbol
};

/// What GridKernels::residuals() reads and writes, one a place. Only `kinds` is told of places not done.
struct GridResiduals {
  const std::int32_t *up1, *expected;
  const std::uint8_t* tolerance;  // null: 0 everywhere
  const std::uint8_t* tables;
  std::int32_t* columns;  // become what a decoder finds: as expected, where within the tolerance
  std::uint8_t* sizes;
  std::uint16_t* codes;  // see rans::code_of()
  std::uint8_t* kinds;
};

/// What GridKernels::columns() reads and writes, one a place.
struct GridColumns {
  const std::uint8_t *there, *symbols, *tables;
  const std::int32_t* expected;
  std::int32_t* columns;
  std::uint8_t* sizes;
  std::uint8_t* kinds;
};

/// Eight cells on their way to symbols, a byte each; see grid::EightCells.
struct GridCellBlock {
  std::uint64_t codes = 0, coded = 0;  // from `first` on; a 1 for those that say something
  std::uint16_t whole = 0;             // what is said of all eight before: its code
  std::uint16_t says_whole = 0;        // 0 or 1
};

/// Sums of products of x0, x1, x2, the differences of the lines above, nearest first, and y, that of the line
/// itself, over places where none is beyond the limit.
struct GridSlopes {
  std::int64_t x0x0 = 0, x0x1 = 0, x0x2 = 0, x1x1 = 0, x1x2 = 0, x2x2 = 0, x0y = 0, x1y = 0, x2y = 0;
  bool operator==(const GridSlopes&) const = default;
};

struct GridKernels {
  const char* name;

  /// `count` rounded up to 8 places. Of no meaning where up1 is absent.
  void (*predict)(const GridRows& rows, const GridModel& model, int count, std::int32_t* expected);

  /// Number of the residuals' table by the sizes of those around on the lines above (codec/FORMAT.md,
  /// "Columns"); kAloneTable where up1 is absent. `sizes` may be read one place before and behind. `count`
  /// rounded up to 8 places.
  void (*contexts)(const std::uint8_t* sizes, const std::int32_t* up1, int count, std::uint8_t* out);

  /// A line's residuals as symbols. `count` rounded up to 8 places.
  void (*residuals)(const GridResiduals& line, int count);

  /// The codes of places that are done, one after the other; behind the last one. `count` rounded up to 8
  /// places, for which there must be room in `to`.
  std::uint16_t* (*pack)(const std::uint16_t* codes, const std::uint8_t* kinds, int count, std::uint16_t* to);

  /// The same of cells; room for nine a block.
  std::uint16_t* (*pack_cells)(const GridCellBlock* blocks, int count, std::uint16_t first,
                               std::uint16_t* to);

  /// The reverse of residuals(). False where a column is out of [-most, most]. `count` rounded up to 8
  /// places.
  bool (*columns)(const GridColumns& line, std::int32_t most, int count);

  /// 1 where there is a vertex, else 0. `count` rounded up to 8 places.
  void (*there)(const std::int32_t* columns, int count, std::uint8_t* out);

  /// Adds to `sums` of what the slopes of a line's columns are fitted by: see GridSlopes.
  void (*slopes)(const std::int32_t* here, const GridRows& rows, std::int32_t limit, int count,
                 GridSlopes& sums);

  /// Cells that are kBothTriangles get their diagonal; `below` is the line below. `count` cells.
  void (*diagonals)(const std::int32_t* above, const std::int32_t* below, std::int32_t spacing, int count,
                    std::uint8_t* cells);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<GridKernels>& all_grid_kernels();

/// The best that runs on this machine.
const GridKernels& grid_kernels();

}  // namespace relievo
