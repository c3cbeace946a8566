// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/smooth_across.h"

#include <cmath>

namespace relievo {
namespace {

// Farther off the cubic than both is the surface itself.
constexpr float kMost_px = 0.1F;
constexpr float kSigmas = 4;
// Standard deviations say more than errors are, the more so the smoother what they are of is.
constexpr float kSaid = 0.95F;

struct Measured {
  float column_px, variance;
};

/// Of a place, between the two before it and the two after it, all as they were measured.
void smooth(const Measured (&of)[5], float& column_px, float& sigma_px) {
  constexpr float kNear = 4.F / 6, kFar = -1.F / 6;  // weights of the cubic
  const Measured& own = of[2];
  const float off = own.column_px - kNear * (of[1].column_px + of[3].column_px) -
                    kFar * (of[0].column_px + of[4].column_px);
  const float variance =
      kNear * kNear * (of[1].variance + of[3].variance) + kFar * kFar * (of[0].variance + of[4].variance);
  const float both = own.variance + variance;
  if (!(std::fabs(off) < kMost_px && off * off < kSigmas * kSigmas * both)) return;
  const float share = own.variance / both;
  column_px -= share * off;
  sigma_px = kSaid * std::sqrt(share * variance);
}

void smooth_line(const DecodedRow& row, int boundaries) {
  const auto measured = [&row](int b) {
    return Measured{row.column_px[b], row.sigma_px[b] * row.sigma_px[b]};
  };
  // The margin holds nothing, on both sides.
  Measured of[5] = {measured(-2), measured(-2), measured(-1), measured(0), measured(1)};
  for (int b = 0; b < boundaries; ++b) {
    for (int i = 0; i < 4; ++i) of[i] = of[i + 1];
    of[4] = measured(b + 2);
    smooth(of, row.column_px[b], row.sigma_px[b]);
  }
}

}  // namespace

void smooth_across(WorkerPool& pool, DecodedGrid& grid) {
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) smooth_line(grid.decoded(line), grid.boundaries());
  });
}

}  // namespace relievo
