// SPDX-License-Identifier: Apache-2.0
#include "codec/grid_predict.h"

namespace relievo {
namespace {

#define RELIEVO_INLINE [[gnu::always_inline]] inline

/// The difference of two places, none where it is out of bounds. Absent places are far from all others.
RELIEVO_INLINE std::int32_t within(std::int32_t a, std::int32_t b, std::int32_t limit) {
  const std::int32_t d = a - b;
  return d <= limit && d >= -limit ? d : 0;
}

RELIEVO_INLINE void predict_body(const GridRows& rows, const GridModel& model, int count,
                                 std::int32_t* __restrict expected) {
  const std::int32_t limit = model.limit;
  const int places = (count + 7) / 8 * 8;
  for (int b = 0; b < places; ++b) {
    const std::int32_t up = rows.up1[b];
    const std::int32_t d1 = within(up, rows.up2[b], limit);
    const std::int32_t d2 = within(rows.up2[b], rows.up3[b], limit);
    const std::int32_t d3 = within(rows.up3[b], rows.up4[b], limit);
    expected[b] = up + ((model.slope1 * d1 + model.slope2 * d2 + model.slope3 * d3 + 128) >> 8);
  }
  if (rows.key == nullptr) return;
  for (int b = 0; b < places; ++b) {
    const std::int32_t change = rows.up1[b] - rows.key_up[b];
    const std::int32_t d = rows.key[b] - expected[b];
    const bool near = change <= limit && change >= -limit && d <= limit && d >= -limit;
    // Of absent places the products would overflow.
    const std::int32_t more =
        (model.key * (near ? d : 0) + model.key_change * (near ? change : 0) + 128) >> 8;
    expected[b] += near ? more : 0;
  }
}

RELIEVO_INLINE void contexts_body(const std::uint8_t* sizes, int count, std::uint8_t* __restrict out) {
  const int places = (count + 7) / 8 * 8;
  for (int b = 0; b < places; ++b) {
    const auto t = static_cast<std::uint8_t>(sizes[b - 1] + 2 * sizes[b] + sizes[b + 1]);
    out[b] = static_cast<std::uint8_t>((t >= 1) + (t >= 2) + (t >= 4) + (t >= 8) + (t >= 16) + (t >= 32));
  }
}

#define RELIEVO_KERNELS(set, attributes)                                                       \
  struct set {                                                                                 \
    attributes static void predict(const GridRows& rows, const GridModel& model, int count,    \
                                   std::int32_t* expected) {                                   \
      predict_body(rows, model, count, expected);                                              \
    }                                                                                          \
    attributes static void contexts(const std::uint8_t* sizes, int count, std::uint8_t* out) { \
      contexts_body(sizes, count, out);                                                        \
    }                                                                                          \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<GridKernels>& all_grid_kernels() {
  static const std::vector<GridKernels> kernels = [] {
    std::vector<GridKernels> out{{"portable", Portable::predict, Portable::contexts}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", Avx2::predict, Avx2::contexts});
#endif
    return out;
  }();
  return kernels;
}

const GridKernels& grid_kernels() {
  return all_grid_kernels().back();
}

}  // namespace relievo
