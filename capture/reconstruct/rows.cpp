// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/rows.h"

namespace relievo {
namespace {

// The bodies are compiled once for every set of instructions: into each of the functions below that call
// them.
#define RELIEVO_BODY [[gnu::always_inline]] inline

RELIEVO_BODY void add_rows_body(const std::uint8_t* own, const std::uint8_t* above, const std::uint8_t* below,
                                int samples, std::uint8_t* __restrict out) {
  for (int i = 0; i < samples; ++i) {
    const auto mean = static_cast<std::uint8_t>((above[i] + below[i] + 1) >> 1);
    const auto sum = static_cast<std::uint8_t>(own[i] + mean);  // wraps where it is over 255
    out[i] = sum < mean ? std::uint8_t{255} : sum;
  }
}

RELIEVO_BODY void combine_fields_body(const std::uint8_t* slide, const std::uint8_t* above,
                                      const std::uint8_t* below, int samples,
                                      std::int16_t* __restrict difference, std::int16_t* __restrict sum) {
  for (int i = 0; i < samples; ++i) {
    const auto lit = static_cast<std::int16_t>(2 * slide[i]);
    const auto unlit = static_cast<std::int16_t>(above[i] + below[i]);
    difference[i] = static_cast<std::int16_t>(lit - unlit);
    sum[i] = static_cast<std::int16_t>(lit + unlit);
  }
}

RELIEVO_BODY void low_pass_body(const std::int16_t* above, const std::int16_t* here,
                                const std::int16_t* below, int samples, std::int16_t* __restrict across,
                                std::int16_t* __restrict out) {
  for (int i = 0; i < samples; ++i) across[i] = static_cast<std::int16_t>(above[i] + 2 * here[i] + below[i]);
  for (int i = 3; i < samples - 3; ++i)
    out[i] = static_cast<std::int16_t>(across[i - 3] + 2 * across[i] + across[i + 3]);
  for (int i = 0; i < 3; ++i) {
    out[i] = static_cast<std::int16_t>(4 * across[i]);
    out[samples - 3 + i] = static_cast<std::int16_t>(4 * across[samples - 3 + i]);
  }
}

RELIEVO_BODY void to_planes_body(const std::int16_t* __restrict difference,
                                 const std::int16_t* __restrict sum, int width, const PlaneWeights& weights,
                                 float* __restrict planes, float* __restrict white) {
  const std::array<float, 9> m = weights.colour;
  const std::array<float, 3> l = weights.luma;
  float* __restrict red = planes;
  float* __restrict green = planes + width;
  float* __restrict blue = planes + 2 * width;
  for (int x = 0; x < width; ++x) {
    const auto r = static_cast<float>(difference[3 * x]);
    const auto g = static_cast<float>(difference[3 * x + 1]);
    const auto b = static_cast<float>(difference[3 * x + 2]);
    red[x] = m[0] * r + m[1] * g + m[2] * b;
    green[x] = m[3] * r + m[4] * g + m[5] * b;
    blue[x] = m[6] * r + m[7] * g + m[8] * b;
  }
  for (int x = 0; x < width; ++x) {
    white[x] = l[0] * static_cast<float>(sum[3 * x]) + l[1] * static_cast<float>(sum[3 * x + 1]) +
               l[2] * static_cast<float>(sum[3 * x + 2]);
  }
}

RELIEVO_BODY void crossings_body(const float* __restrict planes, int width, float least_rise,
                                 std::uint8_t* __restrict flags) {
  const float* __restrict red = planes;
  const float* __restrict green = planes + width;
  const float* __restrict blue = planes + 2 * width;
  const auto crosses = [least_rise](const float* d, int x) {
    const float rise = d[x + 2] - d[x - 1];
    // A crossing's own step goes the way of the sign behind it.
    const int up = (d[x] <= 0) & (d[x + 1] > 0) & (rise >= least_rise);
    const int down = (d[x] > 0) & (d[x + 1] <= 0) & (rise <= -least_rise);
    return up | down;
  };
  for (int x = 0; x < width; ++x) flags[x] = 0;
  for (int x = 2; x < width - 2; ++x)
    flags[x] = static_cast<std::uint8_t>(crosses(red, x) | crosses(green, x) << 1 | crosses(blue, x) << 2);
}

/// All kernels for one set of instructions, as static functions of a struct.
#define RELIEVO_KERNELS(set, attributes)                                                           \
  struct set {                                                                                     \
    attributes static void add_rows(const std::uint8_t* own, const std::uint8_t* above,            \
                                    const std::uint8_t* below, int samples, std::uint8_t* out) {   \
      add_rows_body(own, above, below, samples, out);                                              \
    }                                                                                              \
    attributes static void combine_fields(const std::uint8_t* slide, const std::uint8_t* above,    \
                                          const std::uint8_t* below, int samples, FieldRows out) { \
      combine_fields_body(slide, above, below, samples, out.difference, out.sum);                  \
    }                                                                                              \
    attributes static void low_pass(const std::int16_t* above, const std::int16_t* here,           \
                                    const std::int16_t* below, int samples, std::int16_t* across,  \
                                    std::int16_t* out) {                                           \
      low_pass_body(above, here, below, samples, across, out);                                     \
    }                                                                                              \
    attributes static void to_planes(FieldRows rows, int width, const PlaneWeights& weights,       \
                                     PlaneRows out) {                                              \
      to_planes_body(rows.difference, rows.sum, width, weights, out.planes, out.white);            \
    }                                                                                              \
    attributes static void crossings(const float* planes, int width, float least_rise,             \
                                     std::uint8_t* flags) {                                        \
      crossings_body(planes, width, least_rise, flags);                                            \
    }                                                                                              \
    static RowKernels table(const char* name) {                                                    \
      return {name, add_rows, combine_fields, low_pass, to_planes, crossings};                     \
    }                                                                                              \
  }

RELIEVO_KERNELS(Portable, );
#if defined(__x86_64__)
// Without fused multiply-add, whose results differ in the last bit from the reference's.
RELIEVO_KERNELS(Avx2, [[gnu::target("avx2")]]);
#endif

}  // namespace

const std::vector<RowKernels>& all_row_kernels() {
  static const std::vector<RowKernels> kernels = [] {
    std::vector<RowKernels> out{Portable::table("portable")};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back(Avx2::table("avx2"));
#endif
    return out;
  }();
  return kernels;
}

const RowKernels& row_kernels() {
  return all_row_kernels().back();
}

}  // namespace relievo
