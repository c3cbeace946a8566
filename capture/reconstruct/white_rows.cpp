// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/white_rows.h"

#include <algorithm>
#include <cstdlib>

#include "capture/reconstruct/rows.h"

namespace relievo {
namespace {

// Compiled for wider registers too: the same operations, so the same results.
#define RELIEVO_INLINE __attribute__((always_inline)) inline

RELIEVO_INLINE void sum_body(const float* a, const float* b, int samples, std::uint8_t* out) {
  for (int i = 0; i < samples; ++i)
    out[i] = static_cast<std::uint8_t>(static_cast<int>(std::min(std::max(a[i] + b[i] + 0.5F, 0.F), 255.F)));
}

/// |a - b| of every sample, with one more at both ends like its neighbour: to[-1] to to[samples].
RELIEVO_INLINE void differences(const std::uint8_t* a, const std::uint8_t* b, int samples, std::int16_t* to) {
  for (int i = 0; i < samples; ++i) to[i] = static_cast<std::int16_t>(std::abs(a[i] - b[i]));
  to[-1] = to[0];
  to[samples] = to[samples - 1];
}

/// Sums of three samples in a row are for green the pixel's own three.
RELIEVO_INLINE void weigh(const LitRows& rows, const RowDifferences& d, int samples, float* to) {
  for (int i = 0; i < samples; ++i) {
    const auto a = static_cast<float>(d.above[i - 1] + d.above[i] + d.above[i + 1]);
    const auto b = static_cast<float>(d.below[i - 1] + d.below[i] + d.below[i + 1]);
    const float fa = a * a + RowKernels::kAlike * RowKernels::kAlike;
    const float fb = b * b + RowKernels::kAlike * RowKernels::kAlike;
    to[i] = rows.below[i] + fb / (fa + fb) * (rows.above[i] - rows.below[i]);
  }
}

RELIEVO_INLINE void other_body(const LitRows& rows, int samples, const RowDifferences& scratch, float* out) {
  differences(rows.own, rows.field_above, samples, scratch.above);
  differences(rows.own, rows.field_below, samples, scratch.below);
  weigh(rows, scratch, samples, out);
}
#undef RELIEVO_INLINE

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                                \
  struct set {                                                                                          \
    attributes static void other_field(const LitRows& rows, int samples, const RowDifferences& scratch, \
                                       float* out) {                                                    \
      other_body(rows, samples, scratch, out);                                                          \
    }                                                                                                   \
    attributes static void store_sum(const float* a, const float* b, int samples, std::uint8_t* out) {  \
      sum_body(a, b, samples, out);                                                                     \
    }                                                                                                   \
    static WhiteKernels table(const char* name) { return {name, other_field, store_sum}; }              \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<WhiteKernels>& all_white_kernels() {
  static const std::vector<WhiteKernels> kernels = [] {
    std::vector<WhiteKernels> out{Portable::table("portable")};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back(Avx2::table("avx2"));
#endif
    return out;
  }();
  return kernels;
}

const WhiteKernels& white_kernels() {
  return all_white_kernels().back();
}

}  // namespace relievo
