// SPDX-License-Identifier: Apache-2.0
// What luma's places (luma_place.h) ask of every column of a line. As rows.h: a portable reference, and
// others with the same results for what a processor can do beyond it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace relievo {

/// Of one line: the difference's channels and the sum's luma.
struct LightRows {
  const float *red, *green, *blue, *white;
};

/// Of a line and those beside it; above or below may be the line itself.
struct WhiteRows {
  const float *above, *here, *below;
};

struct LumaKernels {
  const char* name;

  /// `light` is [count][red, green, blue, luma], each over white + `dark`; luma weighs the other three by
  /// `weights`. `luma` is [count], the last of them again.
  void (*ratios)(const LightRows& rows, int count, const std::array<float, 3>& weights, float dark,
                 float* light, float* luma);

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
