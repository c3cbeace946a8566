// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/smooth_columns.h"

#include <cstring>
#include <limits>

#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

// A quadratic along a boundary fits where the worst of its lines is within so many standard deviations.
constexpr float kFit = 3.F;
// What a quadratic's middle lies below the straight line's through the same seven lines, by its bend; its
// variance, of a column's; and how many of its standard deviations, squared, may still be noise.
constexpr float kDip = 4;
constexpr float kDipVariance = 16.F / 84;
constexpr float kMaybeNoise = 4;
constexpr int kBeside = 4;  // boundaries to each side that may share a bend
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// Across boundaries. Farther off the cubic than both is the surface itself.
constexpr float kMost_px = 0.1F;
constexpr float kSigmas = 4;
// Standard deviations say more than errors are, the more so the smoother what they are of is.
constexpr float kSaid = 0.92F;

/// `worst` becomes |off| where that is greater; a NaN that is there first stays.
RELIEVO_INLINE void take(const Eight& off, Eight& worst) {
  const Eight size = off < 0 ? -off : off;
  worst = worst < size ? size : worst;
}

/// Missing neighbours are NaN, which no comparison lets through. `bends` becomes those of the quadratics over
/// seven lines, NaN where none fits.
RELIEVO_INLINE void along_body(const std::array<const float*, 7>& rows, const float* noises, int count,
                               float usual_px, float* bends, float* out) {
  for (int i = 0; i < count; i += 8) {
    Eight a, c, d, e, f, g, h, noise;
    load(rows[0] + i, a);
    load(rows[1] + i, c);
    load(rows[2] + i, d);
    load(rows[3] + i, e);
    load(rows[4] + i, f);
    load(rows[5] + i, g);
    load(rows[6] + i, h);
    load(noises + i, noise);
    const Eight usual = Eight{} + usual_px;
    noise = usual < noise ? noise : usual;
    const Eight limit = kFit * noise;

    const Eight five = (17 * e + 12 * (d + f) - 3 * (c + g)) * (1.F / 35);
    const Eight slope5 = (2 * (g - c) + (f - d)) * 0.1F;
    const Eight bend5 = (2 * (c + g) - (d + f) - 2 * e) * (1.F / 14);
    const Eight off5 = five - e;
    Eight worst5 = off5 < 0 ? -off5 : off5;
    take(five - slope5 + bend5 - d, worst5);
    take(five + slope5 + bend5 - f, worst5);
    take(five - 2 * slope5 + 4 * bend5 - c, worst5);
    take(five + 2 * slope5 + 4 * bend5 - g, worst5);

    const Eight seven = (7 * e + 6 * (d + f) + 3 * (c + g) - 2 * (a + h)) * (1.F / 21);
    const Eight slope7 = (3 * (h - a) + 2 * (g - c) + (f - d)) * (1.F / 28);
    const Eight bend7 = (5 * (a + h) - 3 * (d + f) - 4 * e) * (1.F / 84);
    const Eight off7 = seven - e;
    Eight worst7 = off7 < 0 ? -off7 : off7;
    take(seven - slope7 + bend7 - d, worst7);
    take(seven + slope7 + bend7 - f, worst7);
    take(seven - 2 * slope7 + 4 * bend7 - c, worst7);
    take(seven + 2 * slope7 + 4 * bend7 - g, worst7);
    take(seven - 3 * slope7 + 9 * bend7 - a, worst7);
    take(seven + 3 * slope7 + 9 * bend7 - h, worst7);

    // take() keeps a value where it meets a NaN second, so the values themselves are asked.
    const EightInts good5 = (worst5 <= limit) & (five == five);
    const EightInts good7 = (worst7 <= limit) & (seven == seven);
    store(good7 ? bend7 : Eight{} + kNone, bends + i);
    store(good7 ? seven : good5 ? five : e, out + i);
  }
}

/// `value` less what may be noise of it, after James and Stein.
RELIEVO_INLINE void take_noise(const Eight& variance, Eight& value) {
  const Eight square = value * value;
  const Eight noise = kMaybeNoise * variance;
  value = square > noise ? value - value * (noise / square) : Eight{};
}

/// From quadratics' middles to those of lines, less as much of their dips as is no noise: of the mean of the
/// dips around, and of the own one's difference from that. A line through noise is exact to .38 of a column,
/// a quadratic to .58, but a line alone would make what is bent flatter, the more so the stronger noise is.
RELIEVO_INLINE void share_bends_body(const float* noises, int count, float usual_px, const float* bends,
                                     float* out) {
  for (int i = 0; i < count; i += 8) {
    Eight noise, own, column;
    load(noises + i, noise);
    load(bends + i, own);
    load(out + i, column);
    const Eight usual = Eight{} + usual_px;
    noise = usual < noise ? noise : usual;
    Eight sum = {}, known = {};
    for (int beside = -kBeside; beside <= kBeside; ++beside) {
      Eight bend;
      load(bends + i + beside, bend);
      const EightInts there = bend == bend;
      sum += there ? bend : Eight{};
      known += there ? Eight{} + 1 : Eight{};
    }
    own *= kDip;
    const Eight variance = kDipVariance * noise * noise;
    Eight shared = kDip * sum / known;
    take_noise(variance / known, shared);
    Eight beyond = own - shared;
    take_noise(variance, beyond);
    const Eight smooth = column + own - shared - beyond;
    store(smooth == smooth ? smooth : column, out + i);
  }
}

RELIEVO_INLINE void smooth_body(const std::array<const float*, 7>& rows, const float* noises, int count,
                                float usual_px, float* bends, float* out) {
  along_body(rows, noises, count, usual_px, bends, out);
  share_bends_body(noises, count, usual_px, bends, out);
}

/// A row's numbers at one place and at the two on either side of it.
struct Five {
  Eight far_before, before, own, after, far_after;
};
RELIEVO_INLINE void load_five(const float* row, Five& to) {
  load(row - 2, to.far_before);
  load(row - 1, to.before);
  load(row, to.own);
  load(row + 1, to.after);
  load(row + 2, to.far_after);
}

RELIEVO_INLINE void across_body(float* column_px, float* sigma_px, int count) {
  constexpr float kNear = 4.F / 6, kFar = -1.F / 6;  // weights of the cubic through the four beside a place
  Five column, sigma, next_column, next_sigma;
  load_five(column_px, next_column);
  load_five(sigma_px, next_sigma);
  for (int b = 0; b < count; b += 8) {
    column = next_column;
    sigma = next_sigma;
    // All as it was measured, before this is written.
    load_five(column_px + b + 8, next_column);
    load_five(sigma_px + b + 8, next_sigma);
    const Eight off =
        column.own - kNear * (column.before + column.after) - kFar * (column.far_before + column.far_after);
    const Eight own = sigma.own * sigma.own;
    const Eight variance =
        kNear * kNear * (sigma.before * sigma.before + sigma.after * sigma.after) +
        kFar * kFar * (sigma.far_before * sigma.far_before + sigma.far_after * sigma.far_after);
    const Eight both = own + variance;
    const EightInts foretold = (off < kMost_px) & (off > -kMost_px) & (off * off < kSigmas * kSigmas * both);
    const Eight share = own / both;
    Eight smoothed = share * variance;
    take_root(smoothed);
    store(foretold ? column.own - share * off : column.own, column_px + b);
    store(foretold ? kSaid * smoothed : sigma.own, sigma_px + b);
  }
}

void smooth_portable(const std::array<const float*, 7>& rows, const float* noises, int count, float usual_px,
                     float* bends, float* out) {
  smooth_body(rows, noises, count, usual_px, bends, out);
}
void across_portable(float* column_px, float* sigma_px, int count) {
  across_body(column_px, sigma_px, count);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void smooth_avx2(const std::array<const float*, 7>& rows, const float* noises,
                                         int count, float usual_px, float* bends, float* out) {
  smooth_body(rows, noises, count, usual_px, bends, out);
}
[[gnu::target("avx2")]] void across_avx2(float* column_px, float* sigma_px, int count) {
  across_body(column_px, sigma_px, count);
}
#endif

}  // namespace

const std::vector<Smoother>& smoothers() {
  static const std::vector<Smoother> all = [] {
    std::vector<Smoother> out{{"portable", smooth_portable, across_portable}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", smooth_avx2, across_avx2});
#endif
    return out;
  }();
  return all;
}

}  // namespace relievo
