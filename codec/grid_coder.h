// SPDX-License-Identifier: Apache-2.0
// The stripe grid as bytes: geometry codec 2 of codec/FORMAT.md. Key grids stand alone, delta grids build on
// the last key grid. Bands of lines (slices) are coded each by itself.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/result.h"
#include "base/stream.h"
#include "codec/grid_predict.h"
#include "codec/rans.h"
#include "codec/stripe_grid.h"

namespace relievo {

/// Names a key grid: a hash of its coded bytes.
using GridId = std::uint32_t;
GridId grid_id(std::span<const std::uint8_t> coded);

/// How many places a grid may have, and how many for each of its bytes; writers fill up with zeros.
inline constexpr std::uint64_t kMostGridPlaces = 1U << 24;
inline constexpr std::uint64_t kMostPlacesPerByte = 4096;

struct GridCoding {
  int slice_lines = 270;       // of a band
  WorkerPool* pool = nullptr;  // shares the slices; null: the caller's thread does them all
};

/// What a delta grid builds on.
struct GridKey {
  GridId id = 0;
  StripeGrid grid;
};

/// Everything of a coded grid but its slices.
struct GridHead {
  bool is_key = false;
  bool has_sigmas = false;
  bool has_interpolated = false;
  int step_bits = 4;
  int boundaries = 0;
  int lines = 0;
  bool twice = false;  // as StripeGrid has it
  int slice_lines = 0;
  GridModel model;
  float step_mm = 0;            // what a step is in depth, median of the vertices; informative
  GridId key = 0;               // of a delta grid
  GridCalibration calibration;  // of a key grid
};

/// Keeps its scratch memory from grid to grid. One thread.
class GridEncoder {
 public:
  /// `key` null: a key grid. `tolerance`: how far, in steps, each column may be moved so that it costs less;
  /// empty: lossless. Columns of `grid` become what a decoder will find.
  Bytes encode(StripeGrid& grid, const GridCalibration& calibration, const GridKey* key,
               std::span<const std::uint8_t> tolerance, float step_mm, const GridCoding& coding);

 private:
  struct Slice;
  std::vector<Slice> slices_;

 public:
  GridEncoder();
  ~GridEncoder();
  GridEncoder(GridEncoder&&) noexcept;
  GridEncoder& operator=(GridEncoder&&) noexcept;
};

/// Of cells that hold kBothTriangles, with the columns of their corners.
void choose_diagonals(StripeGrid& grid, std::int32_t spacing);

/// How many bytes a coded grid must have at least (FORMAT.md, "Sizes").
std::size_t least_grid_bytes(const StripeGrid& grid);

/// Any bytes.
Result<GridHead> read_grid_head(std::span<const std::uint8_t> coded);

/// Keeps its scratch memory from grid to grid. One thread.
class GridDecoder {
 public:
  GridDecoder();
  ~GridDecoder();
  GridDecoder(GridDecoder&&) noexcept;
  GridDecoder& operator=(GridDecoder&&) noexcept;

  /// Any bytes. Fails unless the grid holds `vertices` and `triangles`, fewer where slices are lost; that is
  /// checked before anything is allocated. `key`: of a delta grid, the one it names.
  Result<GridHead> decode(std::span<const std::uint8_t> coded, std::uint32_t vertices,
                          std::uint32_t triangles, const GridKey* key, StripeGrid& out,
                          WorkerPool* pool = nullptr);

 private:
  struct Scratch;
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
