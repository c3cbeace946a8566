// SPDX-License-Identifier: Apache-2.0
// The head of a coded grid: sizes, prediction, calibration, tables (codec/FORMAT.md, "Geometry codec 2").
#pragma once

#include <span>

#include "codec/grid_coder.h"

namespace relievo {

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
