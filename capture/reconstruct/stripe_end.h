// SPDX-License-Identifier: Apache-2.0
// From one stripe's colour to the next one's, as lens, pixel and projector blur it: for models of what a
// camera shows around a boundary.
#pragma once

namespace relievo {

/// 0..1, into `out`: how much of the stripe right of an end there is `off_px` behind it. Smooth, so that no
/// shift comes from where the columns' samples happen to lie. `Real`: float, or a vector of many (GCC's
/// extension).
template <class Real>
[[gnu::always_inline]] inline void behind_end(const Real& off_px, Real& out) {
  constexpr float kRamp_px = 3.2F;
  Real share = 0.5F + off_px * (1 / kRamp_px);
  share = share < 0.F ? Real{} : share;
  share = share > 1.F ? Real{} + 1.F : share;
  out = share * share * (3.F - 2.F * share);
}

inline float behind_end(float off_px) {
  float out;
  behind_end(off_px, out);
  return out;
}

}  // namespace relievo
