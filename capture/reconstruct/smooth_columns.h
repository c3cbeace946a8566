// SPDX-License-Identifier: Apache-2.0
// Noise averaged along a boundary: its columns on a line and on the three above and below; and across
// boundaries. As rows.h: a portable reference, and others with the same results for what a processor can do
// beyond it.
#pragma once

#include <array>
#include <vector>

namespace relievo {

struct Smoother {
  const char* name;

  /// rows[3] is the line's own columns, one a boundary, NaN where there is none; rows[0] is three lines
  /// above, rows[6] three below. `out` becomes what a quadratic over all seven, or else one over the middle
  /// five (Savitzky-Golay) makes of rows[3], where it fits as well as noise lets it, and rows[3] itself
  /// elsewhere. Bends over seven lines that may as well be noise count as none, and those that may be alike
  /// as alike. Noise is noises[b] or `usual_px`, whichever is greater. Every row is as long as `count`
  /// rounded up to a multiple of eight; `bends` is scratch, and NaN in the four places before and behind.
  void (*smooth)(const std::array<const float*, 7>& rows, const float* noises, int count, float usual_px,
                 float* bends, float* out);

  /// As smooth_across.h, of a line: one a boundary, `count` rounded up to a multiple of eight of them, and
  /// read from two places before the first to ten behind that.
  void (*across)(float* column_px, float* sigma_px, int count);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<Smoother>& smoothers();

}  // namespace relievo
