// SPDX-License-Identifier: Apache-2.0
// The head of a coded grid: sizes, prediction, calibration, tables (codec/FORMAT.md, "Geometry codec 2").
#pragma once

#include <span>

#include "codec/byte_io.h"
#include "codec/grid_coder.h"

namespace relievo {

/// What codecs 2 and 3 begin, or end, with: sizes, prediction, calibration or the key grid's id.
void write_grid_fields(const GridHead& head, Bytes& out);
/// Any bytes.
Status read_grid_fields(ByteReader& in, GridHead& head);

/// `tables`: the alphabets' levels.
void write_grid_head(const GridHead& head, const Bytes& tables, Bytes& out);

struct GridLayout {
  GridHead head;
  std::span<const std::uint8_t> tables;
  std::vector<std::span<const std::uint8_t>> slices;  // empty: lost
};
/// Any bytes.
Result<GridLayout> read_grid_layout(std::span<const std::uint8_t> coded);

}  // namespace relievo
