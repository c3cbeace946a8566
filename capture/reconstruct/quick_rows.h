// SPDX-License-Identifier: Apache-2.0
// The loops of the quick decoder (quick_difference.h, quick_sequence.h), in whole numbers of 16 bits. As
// rows.h: a portable reference, and others with the same results for what a processor can do beyond it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace relievo {

/// Weights of captured RGB, by which a low-passed row of FieldRows (rows.h) becomes the difference's channels
/// and the sum luma: row-major, in 2^-13.
struct QuickWeights {
  std::array<std::int16_t, 9> colour;
  std::array<std::int16_t, 3> luma;
};

/// A line of the difference, a plane a channel, in grey levels times QuickKernels::kScale.
struct QuickRow {
  const std::int16_t *red, *green, *blue;
};

/// A place between columns x and x + 1 where channels cross zero: bit c of `channels`.
struct Crossing {
  std::uint16_t x;
  std::uint16_t channels;
};

/// Crossings that are one edge: where it is, and the root of the sum of the channels' squared slopes, in
/// units of the difference a pixel.
struct QuickPlace {
  float column_px, slope;
};

/// Columns on both sides of an edge, kMost at most on each; none is outside of the row.
struct QuickSpans {
  static constexpr int kMost = 4;
  std::int16_t left_first, right_first;
  std::int16_t left_count, right_count;
};

/// Sums of red, green and blue over each side's columns; the fourth is 0.
struct QuickSides {
  std::array<float, 4> left, right;
};

struct QuickKernels {
  static constexpr int kScale = 8;       // of a grey level in the difference and luma
  static constexpr float kClear = 0.5F;  // of 1: a channel's size over that of the colour (kClearShare of
  static constexpr float kClearShare =
      0.4F;  // the largest channel, and the doubt), from which on it is clear

  /// Of a column's code: signs of red, green and blue, 1 above 0, and whether all are clear.
  static constexpr std::uint8_t kSigns = 7, kIsClear = 8;

  const char* name;

  /// A line's three planes, `stride` apart, and luma, all of `width`.
  void (*to_planes)(const std::int16_t* difference, const std::int16_t* sum, int width,
                    const QuickWeights& weights, std::int16_t* planes, int stride, std::int16_t* luma);

  /// The code of each column. `doubt` is in units of the difference, at most 16383.
  void (*codes)(const QuickRow& row, int width, std::int16_t doubt, std::uint8_t* out);

  /// Crossings between columns 1 and width - 2 that go on the same way by `least_rise` or more from x - 1 to
  /// x + 2; from left to right, a column once. `out` has room for `width`. Returns how many.
  int (*crossings)(const QuickRow& row, int width, std::int16_t least_rise, Crossing* out);

  /// Puts crossings less than kMerge_px apart into one place, weighed by their squared slopes. Returns how
  /// many there are; `out` has room for `count` and kGathered more.
  static constexpr int kMerge_px = 2;
  static constexpr int kGathered = 8;
  int (*gather)(const QuickRow& row, const Crossing* crossings, int count, QuickPlace* out);

  /// Of one edge. Rows can be read for kMost columns behind their last.
  void (*sides)(const QuickRow& row, const QuickSpans& spans, QuickSides& out);

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
