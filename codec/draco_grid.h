// SPDX-License-Identifier: Apache-2.0
// The stripe grid in two Draco point clouds: geometry codec 3 of codec/FORMAT.md. Each stands alone.
#pragma once

#include <cstdint>
#include <span>

#include "base/result.h"
#include "base/stream.h"
#include "codec/grid_coder.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// Of a grid with at least one vertex. `tolerance`: how far, in steps, each column may be moved so that it
/// costs less; empty: lossless. Columns of `grid` become what a decoder will find, its counts too. Any
/// thread.
Result<Bytes> encode_draco_grid(StripeGrid& grid, const GridCalibration& calibration,
                                std::span<const std::uint8_t> tolerance, float step_mm);

/// Any bytes. Fails unless the grid holds exactly `vertices` and `triangles`; what could take memory is
/// checked before it does. Any thread.
Result<GridHead> decode_draco_grid(std::span<const std::uint8_t> coded, std::uint32_t vertices,
                                   std::uint32_t triangles, StripeGrid& out);

}  // namespace relievo
