// SPDX-License-Identifier: Apache-2.0
// What luma's places (luma_place.h) ask of every column of a line. As rows.h: a portable reference, and
// others with the same results for what a processor can do beyond it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/pattern.h"

namespace relievo {

/// Of one line: the difference's channels and the sum's luma.
struct LightRows {
  const float *red, *green, *blue, *white;
};

/// Of a line and those beside it; above or below may be the line itself.
struct WhiteRows {
  const float *above, *here, *below;
};

/// Rows of ratios: the difference's channels and their luma, each over the sum's.
struct RatioRows {
  float *red, *green, *blue, *luma;
};

/// Ratios of consecutive columns of a line; whoever made them owns the memory. Rows can be read kMargin
/// entries before their first column and behind their last.
struct LumaView {
  static constexpr int kMargin = 8;
  int first;  // column of the first entry of each
  const float *red, *green, *blue, *luma;
  const std::uint8_t*
      ends;  // 1: the scene changes from the column before to the one behind; all of the margin
};

struct LumaSides {
  float free_left_px, free_right_px;  // to the next edges
  std::array<Primary, 2> colours;     // left and right, under the slide that the image shows
  bool narrow = false;                // there may be less than two pixels of a surface
};

/// A boundary near `own_px`, kLumaReach_px or more inside the line.
struct LumaQuery {
  float own_px;
  LumaSides sides;
};

struct LumaPlace {
  float column_px = 0;
  float slope = 0;  // of the ratio, a pixel
  float rise = 0;   // from the left level to the right one
  bool found = false;
};

constexpr int kLumaReach_px = 7;  // columns to each side of a place that it takes

/// Weights of the difference's channels in luma, and how much of what the frame shows is the projector's
/// light.
struct LumaLight {
  std::array<float, 3> weights;
  float share;
};

struct LumaKernels {
  const char* name;

  /// Each of the difference's channels over white + `dark`, and their sum weighed by `weights`.
  void (*ratios)(const LightRows& rows, int count, const std::array<float, 3>& weights, float dark,
                 const RatioRows& out);

  /// Where luma has each of `count` boundaries; see luma_place.h.
  void (*places)(const LumaView& view, const LumaLight& light, const LumaQuery* queries, int count,
                 LumaPlace* out);

  /// ends[x] is 1 where white changes by more than `share` of its sum + `dark` from x - 1 to x + 1: of
  /// columns [0, count), so that white[-1] and white[count] are read.
  void (*ends)(const float* white, int count, float share, float dark, std::uint8_t* ends);

  /// Brightest and darkest of three rows in each column [0, count). Where stripes are wide, for the darkest
  /// a row counts in a column as the brightest of three beside each other; columns -1 and `count` are read.
  void (*extremes)(const WhiteRows& rows, int count, bool wide_stripes, float* brightest, float* darkest);

  /// (brightest - darkest) / (brightest + darkest + dark) over `around` columns to each side (2 or 4), for
  /// columns [0, count): from -around to count + around - 1 is read.
  void (*contrasts)(const float* brightest, const float* darkest, int count, int around, float dark,
                    float* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<LumaKernels>& all_luma_kernels();

/// The best that runs on this machine.
const LumaKernels& luma_kernels();

}  // namespace relievo
