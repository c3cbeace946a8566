// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/consistency_rows.h"

#include "base/variants.h"
#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

RELIEVO_INLINE void size_of(const Eight& v, Eight& out) {
  out = v < 0 ? -v : v;
}
RELIEVO_INLINE void least_of(const Eight& a, const Eight& b, Eight& out) {
  out = b < a ? b : a;
}

// Where a neighbour is missing all comparisons are with NaN, and false.
RELIEVO_INLINE void neighbourhoods_body(const ColumnRows& rows, const float* noise_px, float least_noise_px,
                                        int count, const NeighbourhoodLimits& limits, std::uint8_t* out) {
  for (int b = 0; b < count; b += 8) {
    Eight here, left, right, second_left, second_right, above, below, noise;
    load(rows.here + b, here);
    load(rows.here + b - 1, left);
    load(rows.here + b + 1, right);
    load(rows.here + b - 2, second_left);
    load(rows.here + b + 2, second_right);
    load(rows.above + b, above);
    load(rows.below + b, below);
    load(noise_px + b, noise);
    const Eight least = Eight{} + least_noise_px;
    noise = noise < least ? least : noise;
    const Eight across = left - 2 * here + right;
    const Eight spacing = 0.5F * (right - left);
    const Eight along = above - 2 * here + below;
    Eight across_size, along_size;
    size_of(across, across_size);
    size_of(along, along_size);
    const EightInts bent_across =
        across_size > limits.across_px + limits.across_share * spacing + limits.noise * noise;
    const EightInts bent_along = along_size > limits.along_px + limits.noise * noise;

    const Eight to_left = here - left;
    const Eight to_right = right - here;
    const Eight before = left - second_left;
    const Eight after = second_right - right;
    Eight beside;
    least_of(before, after, beside);
    const EightInts in_front = (to_left < 0) | (to_right < 0);  // another surface
    const EightInts both = (to_left == to_left) & (to_right == to_right);
    const EightInts squeezed_both = (to_left + to_right < 2 * limits.squeezed * beside) &
                                    (to_left < limits.squeezed_each * before) &
                                    (to_right < limits.squeezed_each * after);
    // One of the two is missing, and then what is behind it is not asked.
    const EightInts squeezed_one = (to_right == to_right ? to_right < limits.squeezed_alone * after
                                                         : to_left < limits.squeezed_alone * before);
    const EightInts squeezed = (both ? squeezed_both : squeezed_one) & ~in_front;
    const EightInts bits = ((across != across) & Neighbourhood::kOpenAcross) |
                           (bent_across & Neighbourhood::kBentAcross) |
                           ((along != along) & Neighbourhood::kOpenAlong) |
                           (bent_along & Neighbourhood::kBentAlong) | (squeezed & Neighbourhood::kSqueezed);
    store(bits, out + b);
  }
}

RELIEVO_INLINE void average_body(const float* measured_px, const float* smooth_px, const float* noise_px,
                                 int count, float averaged, float* sigma_px) {
  for (int b = 0; b < count; b += 8) {
    Eight measured, smooth, noise, sigma;
    load(measured_px + b, measured);
    load(smooth_px + b, smooth);
    load(noise_px + b, noise);
    load(sigma_px + b, sigma);
    const Eight variance = sigma * sigma;
    const Eight less = variance - averaged * noise * noise;
    const Eight least = 0.5F * variance;
    Eight reduced = less < least ? least : less;
    take_root(reduced);
    store(smooth != measured ? reduced : sigma, sigma_px + b);
  }
}

RELIEVO_INLINE void to_instant_body(const TwoFrames& frames, int count, const InstantRules& rules,
                                    float* column_px, float* sigma_px) {
  for (int b = 0; b < count; b += 8) {
    Eight now, before, sigma, before_sigma;
    load(frames.now.here + b, now);
    load(frames.before.here + b, before);
    load(frames.sigma_px + b, sigma);
    load(frames.before_sigma_px + b, before_sigma);
    const Eight moved = now - before;
    Eight size;
    size_of(moved, size);
    const Eight slack = rules.alike_px + rules.alike_share * size;
    EightInts alike{};
    const auto ask = [&](const float* n, const float* p) __attribute__((always_inline)) {
      Eight neighbour, was, apart;
      load(n + b, neighbour);
      load(p + b, was);
      size_of(neighbour - was - moved, apart);
      alike -= apart < slack;
    };
    ask(frames.now.above, frames.before.above);
    ask(frames.now.below, frames.before.below);
    ask(frames.now.here - 1, frames.before.here - 1);
    ask(frames.now.here + 1, frames.before.here + 1);
    const EightInts still = size <= rules.still_px;
    const EightInts goes_along = (size <= rules.furthest_px) & (alike >= 2);
    const EightInts use = (sigma < rules.worst_px) & (before_sigma < rules.worst_px) & (still | goes_along);
    const Eight kept = (1 - rules.share) * sigma;
    const Eight added = rules.share * before_sigma;
    Eight both = kept * kept + added * added;
    take_root(both);
    store(use ? now - rules.share * moved : now, column_px + b);
    store(use ? both : sigma, sigma_px + b);
  }
}

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                                    \
  struct set {                                                                                              \
    attributes static void neighbourhoods(const ColumnRows& rows, const float* noise_px,                    \
                                          float least_noise_px, int count,                                  \
                                          const NeighbourhoodLimits& limits, std::uint8_t* out) {           \
      neighbourhoods_body(rows, noise_px, least_noise_px, count, limits, out);                              \
    }                                                                                                       \
    attributes static void average(const float* measured_px, const float* smooth_px, const float* noise_px, \
                                   int count, float averaged, float* sigma_px) {                            \
      average_body(measured_px, smooth_px, noise_px, count, averaged, sigma_px);                            \
    }                                                                                                       \
    attributes static void to_instant(const TwoFrames& frames, int count, const InstantRules& rules,        \
                                      float* column_px, float* sigma_px) {                                  \
      to_instant_body(frames, count, rules, column_px, sigma_px);                                           \
    }                                                                                                       \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<ConsistencyKernels>& all_consistency_kernels() {
  const ConsistencyKernels portable{"portable", Portable::neighbourhoods, Portable::average,
                                    Portable::to_instant};
#if defined(__x86_64__)
  static const auto kernels =
      variants(portable, {"avx2", Avx2::neighbourhoods, Avx2::average, Avx2::to_instant});
#else
  static const auto kernels = variants(portable);
#endif
  return kernels;
}

const ConsistencyKernels& consistency_kernels() {
  return all_consistency_kernels().back();
}

}  // namespace relievo
