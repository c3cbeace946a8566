// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/sharp_luma.h"

#include <algorithm>

namespace relievo {
namespace {

/// Rec. 601, of the captured colours.
float luma(const std::uint8_t* rgb) {
  return 0.299F * static_cast<float>(rgb[0]) + 0.587F * static_cast<float>(rgb[1]) +
         0.114F * static_cast<float>(rgb[2]);
}

}  // namespace

void SharpLuma::ratio(int line, int first, int count, float dark, float* ratio) const {
  std::fill_n(ratio, count, 0.F);
  const auto sign = static_cast<float>(rows_.sign());
  for (int l = line - 1; l <= line + 1; ++l) {
    const float weight = sign * (l == line ? 0.5F : 0.25F);
    const int here = std::clamp(l, 0, rows_.own.height - 1);
    const std::uint8_t* lit = rows_.own.row(here) + 3 * first;
    const std::uint8_t* above = rows_.other_above(here) + 3 * first;
    const std::uint8_t* below = rows_.other_below(here) + 3 * first;
    for (int i = 0; i < count; ++i) {
      const float a = luma(lit + 3 * i);
      const float b = 0.5F * (luma(above + 3 * i) + luma(below + 3 * i));
      ratio[i] += weight * (a - b) / (a + b + dark);
    }
  }
}

}  // namespace relievo
