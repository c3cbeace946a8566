// SPDX-License-Identifier: Apache-2.0
// Where a row of samples crosses a level, to a fraction of a column. A straight line between the two samples
// around it is off by up to 0.03 px, which is more than noise: a boundary's edge bends within a pixel. Four
// samples tell how.
#pragma once

namespace relievo {

/// How far behind the second of four samples next to each other the row crosses zero, in columns, 0 to 1,
/// into `out`; the second and third are on its two sides. `Real`: float, or a vector of many (GCC's
/// extension).
template <class Real>
[[gnu::always_inline]] inline void crossing_of(const Real& s0, const Real& s1, const Real& s2, const Real& s3,
                                               Real& out) {
  // Of a rise over three columns by that over the middle one: 3 is a straight line, whose bend is noise
  // alone; of edges as sharp as cameras have them (2.3) a cubic shows little more than half of the bend.
  constexpr float kStraight = 2.8F;
  constexpr float kBlend = 4;
  constexpr float kMost = 1.75F;

  const Real step = s2 - s1;
  const Real unit = 1.F / step;
  const Real straight = -s1 * unit;
  // What the cubic through all four adds to the line there (Everett's form), and the cubic's slope.
  const Real before = s0 - 2.F * s1 + s2;
  const Real after = s1 - 2.F * s2 + s3;
  const Real bend = ((2.F - straight) * before + (1.F + straight) * after) * (1.F / 6);
  const Real within = straight * (straight - 1.F);
  const Real slope = step + (2.F * straight - 1.F) * bend + within * (after - before) * (1.F / 6);
  Real share = kBlend * (kStraight - (s3 - s0) * unit);
  share = share > 0.F ? share : 0.F;
  share = share < kMost ? share : kMost;
  const Real place = straight - share * within * bend / slope;
  // What is no edge may bend so much that the cubic crosses elsewhere.
  out = ((place >= 0.F) & (place <= 1.F)) ? place : straight;
}

/// The same behind s[0], of a row that crosses `level`; s[-1] to s[2] are read.
[[gnu::always_inline]] inline float crossing_behind(const float* s, float level) {
  float out;
  crossing_of(s[-1] - level, s[0] - level, s[1] - level, s[2] - level, out);
  return out;
}

}  // namespace relievo
