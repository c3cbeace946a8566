// SPDX-License-Identifier: Apache-2.0
// What is done to every sample of a picture, a row at a time: the loops that decide how fast a frame is read.
// One portable implementation, which is the reference, and others for what a processor can do beyond it; all
// give the same results, and the best that runs here is chosen once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace relievo {

/// A frame's two fields at one line, before any low-pass: whole numbers, interleaved RGB.
struct FieldRows {
  std::int16_t* difference;  // 2 slide - (above + below): twice the difference, -510..510
  std::int16_t* sum;         // 2 slide + (above + below): twice the sum, 0..1020
};

/// Weights that turn a low-passed row of FieldRows into planes: of the difference's channels by captured RGB,
/// row-major, and of the sum's luma.
struct PlaneWeights {
  std::array<float, 9> colour;
  std::array<float, 3> luma;
};

/// `planes` is [3][width], `white` [width].
struct PlaneRows {
  float* planes;
  float* white;
};

/// Columns [first, last] on both sides of an edge, and what is added to the colours' size in each. Columns
/// are of the row.
struct SideWindows {
  int left_first, left_last, right_first, right_last;
  float left_doubt, right_doubt;
};

/// Of red, green and blue; the fourth is 0.
struct Sides {
  std::array<float, 4> left, right;
};

/// A picture's row, those beside it, and those beyond them.
struct WovenRows {
  const std::uint8_t *own, *above, *below, *beyond_above, *beyond_below;
};

/// Both exposures' rows of a line and of the next one.
struct LinePair {
  const std::uint8_t *own, *other, *next_own, *next_other;
};

/// Sums over a block's samples of own less other: of one line's times the next one's, and of their squares.
struct PairProducts {
  std::int32_t across = 0, here = 0, next = 0;
};

/// Every pointer is to a row of its own; none overlap but where said. `samples` is 3 * width.
struct RowKernels {
  static constexpr float kClearShare = 0.4F;
  static constexpr float kLowPassed =
      32;  // times what the fields hold: FieldRows, twice that, after low_pass()
  static constexpr int kPairBlock_px = 8;
  static constexpr float kAlike = 24;  // sum of three samples' differences: rows below it belong together

  const char* name;

  /// out = own + (above + below) / 2, rounded up, 255 at most. `above` and `below` may be the same.
  void (*add_rows)(const std::uint8_t* own, const std::uint8_t* above, const std::uint8_t* below, int samples,
                   std::uint8_t* out);

  /// out = own + what lies between `above` and `below`, rounded, 255 at most. That is the nearer to the one
  /// whose row beyond (`beyond_above`, `beyond_below`) differs less from `own`, by the sum of three samples
  /// in a row; at the ends the last of them counts twice. `differences` is scratch memory of 2 (samples + 2).
  void (*weave_rows)(const WovenRows& rows, int samples, std::uint8_t* differences, std::uint8_t* out);

  /// Difference and sum of a slide's row and the complement's two rows about it, which may be the same.
  void (*combine_fields)(const std::uint8_t* slide, const std::uint8_t* above, const std::uint8_t* below,
                         int samples, FieldRows out);

  /// Low-pass [1 2 1] across three lines of either of FieldRows and then along the line, whose ends stay:
  /// 16 times as large as it came. The three may be the same. `across` is scratch memory.
  void (*low_pass)(const std::int16_t* above, const std::int16_t* here, const std::int16_t* below,
                   int samples, std::int16_t* across, std::int16_t* out);

  /// Of each of `blocks` blocks of kPairBlock_px pixels.
  void (*pair_products)(const LinePair& pair, int blocks, PairProducts* out);

  /// Planes from interleaved rows.
  void (*to_planes)(FieldRows rows, int width, const PlaneWeights& weights, PlaneRows out);

  /// Bit c of flags[x] is set where channel c of `planes` ([3][width]) crosses zero between columns x and
  /// x + 1 and rises or falls the same way by `least_rise` or more from x - 1 to x + 2. `flags` is [width].
  void (*crossings)(const float* planes, int width, float least_rise, std::uint8_t* flags);

  /// For each of `count` edges: mean m of `planes` ([3][width]) in each window over kClearShare * (largest
  /// |m| of the channels) + doubt, clamped to -1..1.
  void (*side_evidence)(const float* planes, int width, const SideWindows* windows, int count, Sides* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<RowKernels>& all_row_kernels();

/// The best that runs on this machine.
const RowKernels& row_kernels();

}  // namespace relievo
