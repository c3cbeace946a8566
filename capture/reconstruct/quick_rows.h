// SPDX-License-Identifier: Apache-2.0
// The loops of the quick decoder (quick_difference.h, quick_sequence.h), in whole numbers of 16 bits. As
// rows.h: a portable reference, and others with the same results for what a processor can do beyond it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace relievo {

/// Weights of captured RGB, by which a low-passed row of FieldRows (rows.h) becomes quads, and the sum luma:
/// row-major, in 2^-13.
struct QuadWeights {
  std::array<std::int16_t, 9> colour;
  std::array<std::int16_t, 3> luma;
};

/// A place between columns x and x + 1 where channels cross zero: bit c of `channels`.
struct Crossing {
  std::uint16_t x;
  std::uint16_t channels;
};

/// Crossings that are one edge: where it is, and the root of the sum of the channels' squared slopes, in
/// units of quads a pixel.
struct QuickPlace {
  float column_px, slope;
};

/// Columns on both sides of an edge, kMost at most on each; none is outside of the row.
struct QuadSpans {
  static constexpr int kMost = 4;
  std::int16_t left_first, right_first;
  std::int16_t left_count, right_count;
};

/// What the two sides of an edge show.
struct QuadSides {
  std::array<float, 4> left, right;  // sums of red, green and blue over the side's columns; the fourth is 0
  std::uint8_t code;  // signs: bits 3 to 5 are the left's channels, 0 to 2 the right's; 1: above 0
  bool clear;         // no channel's sign is in doubt
};

struct QuickKernels {
  static constexpr int kScale = 8;       // of a grey level in quads and luma
  static constexpr float kClear = 0.5F;  // of 1: a channel's size over that of the colour (kClearShare of
  static constexpr float kClearShare =
      0.4F;  // the largest channel, and the doubt), from which on it is clear

  const char* name;

  /// Quads [width][red, green, blue, 0] and luma [width] of a line.
  void (*to_quads)(const std::int16_t* difference, const std::int16_t* sum, int width,
                   const QuadWeights& weights, std::int16_t* quads, std::int16_t* luma);

  /// Crossings between columns 1 and width - 2 that go on the same way by `least_rise` or more from x - 1 to
  /// x + 2; from left to right, a column once. `out` has room for `width`. Returns how many.
  int (*crossings)(const std::int16_t* quads, int width, std::int16_t least_rise, Crossing* out);

  /// Puts crossings less than kMerge_px apart into one place, weighed by their squared slopes. Returns how
  /// many there are; `out` has room for `count`.
  static constexpr int kMerge_px = 2;
  int (*gather)(const std::int16_t* quads, const Crossing* crossings, int count, QuickPlace* out);

  /// Of `count` edges. `doubt` is of each column.
  void (*sides)(const std::int16_t* quads, const QuadSpans* spans, int count, float doubt, QuadSides* out);

  /// Brightest and darkest luma within kAround columns to each side, on three lines, of columns
  /// [kAround, width - kAround).
  static constexpr int kAround = 4;
  void (*extremes)(const std::int16_t* above, const std::int16_t* here, const std::int16_t* below, int width,
                   std::int16_t* brightest, std::int16_t* darkest);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<QuickKernels>& all_quick_kernels();

/// The best that runs on this machine.
const QuickKernels& quick_kernels();

}  // namespace relievo
