// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/luma_rows.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

// Compiled once for every set of instructions, as in rows.cpp.
#define RELIEVO_BODY [[gnu::always_inline]] inline

RELIEVO_BODY void ratios_body(const float* __restrict red, const float* __restrict green,
                              const float* __restrict blue, const float* __restrict white, int count,
                              const std::array<float, 3> weights, float dark, float* __restrict light,
                              float* __restrict luma) {
  for (int x = 0; x < count; ++x) {
    const float unit = 1.F / (white[x] + dark);
    const float r = red[x] * unit;
    const float g = green[x] * unit;
    const float b = blue[x] * unit;
    const float l = weights[0] * r + weights[1] * g + weights[2] * b;
    light[4 * x] = r;
    light[4 * x + 1] = g;
    light[4 * x + 2] = b;
    light[4 * x + 3] = l;
    luma[x] = l;
  }
}

RELIEVO_BODY void ends_body(const float* __restrict white, int count, float share, float dark,
                            std::uint8_t* __restrict ends) {
  for (int x = 0; x < count; ++x)
    ends[x] = std::fabs(white[x + 1] - white[x - 1]) > share * (white[x + 1] + white[x - 1] + dark) ? 1 : 0;
}

RELIEVO_BODY void extremes_body(const WhiteRows rows, int count, bool wide_stripes,
                                float* __restrict brightest, float* __restrict darkest) {
  const float* a = rows.above;
  const float* h = rows.here;
  const float* b = rows.below;
  for (int x = 0; x < count; ++x) brightest[x] = std::max(std::max(a[x], h[x]), b[x]);
  if (!wide_stripes) {
    for (int x = 0; x < count; ++x) darkest[x] = std::min(std::min(a[x], h[x]), b[x]);
    return;
  }
  const auto of_three = [](const float* w, int x) __attribute__((always_inline)) {
    return std::max(std::max(w[x - 1], w[x]), w[x + 1]);
  };
  for (int x = 0; x < count; ++x)
    darkest[x] = std::min(std::min(of_three(a, x), of_three(h, x)), of_three(b, x));
}

template <int around>
RELIEVO_BODY void contrasts_within(const float* __restrict brightest, const float* __restrict darkest,
                                   int count, float dark, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    float most = brightest[x - around];
    float least = darkest[x - around];
    for (int i = 1 - around; i <= around; ++i) {
      most = std::max(most, brightest[x + i]);
      least = std::min(least, darkest[x + i]);
    }
    out[x] = (most - least) / (most + least + dark);
  }
}

RELIEVO_BODY void contrasts_body(const float* brightest, const float* darkest, int count, int around,
                                 float dark, float* out) {
  if (around == 2) {
    contrasts_within<2>(brightest, darkest, count, dark, out);
  } else {
    contrasts_within<4>(brightest, darkest, count, dark, out);
  }
}

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                                     \
  struct set {                                                                                               \
    attributes static void ratios(const LightRows& rows, int count, const std::array<float, 3>& weights,     \
                                  float dark, float* light, float* luma) {                                   \
      ratios_body(rows.red, rows.green, rows.blue, rows.white, count, weights, dark, light, luma);           \
    }                                                                                                        \
    attributes static void ends(const float* white, int count, float share, float dark, std::uint8_t* out) { \
      ends_body(white, count, share, dark, out);                                                             \
    }                                                                                                        \
    attributes static void extremes(const WhiteRows& rows, int count, bool wide_stripes, float* brightest,   \
                                    float* darkest) {                                                        \
      extremes_body(rows, count, wide_stripes, brightest, darkest);                                          \
    }                                                                                                        \
    attributes static void contrasts(const float* brightest, const float* darkest, int count, int around,    \
                                     float dark, float* out) {                                               \
      contrasts_body(brightest, darkest, count, around, dark, out);                                          \
    }                                                                                                        \
    static LumaKernels table(const char* name) { return {name, ratios, ends, extremes, contrasts}; }         \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<LumaKernels>& all_luma_kernels() {
  static const std::vector<LumaKernels> kernels = [] {
    std::vector<LumaKernels> out{Portable::table("portable")};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back(Avx2::table("avx2"));
#endif
    return out;
  }();
  return kernels;
}

const LumaKernels& luma_kernels() {
  return all_luma_kernels().back();
}

}  // namespace relievo
