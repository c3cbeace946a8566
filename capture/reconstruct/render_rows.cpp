// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/render_rows.h"

#include <cstring>

#include "capture/reconstruct/eight.h"
#include "capture/reconstruct/stripe_end.h"

namespace relievo {
namespace {

/// Adds how unlike `picture` is to `shown`.
RELIEVO_INLINE void compare(const Eight& picture, const float* shown, const Eight& scale, Eight& sum) {
  Eight as_shown;
  load(shown, as_shown);
  const Eight apart = (as_shown - picture) * scale;
  const Eight square = apart * apart;
  sum += square / (1 + square);
}

RELIEVO_INLINE float unlike_body(const RenderedRow& row, float column_px) {
  constexpr std::size_t kEight = 8;
  RenderedRow::In right;
  std::array<RenderedRow::In, 2> sharp;
  const Eight steps = {0, 1, 2, 3, 4, 5, 6, 7};
  const float off = row.first_px - column_px;
  for (std::size_t i = 0; i < RenderedRow::kIn; i += kEight) {
    Eight of_right;
    behind_end(steps + (off + static_cast<float>(i)), of_right);
    std::memcpy(right.data() + i, &of_right, sizeof of_right);
    for (std::size_t c = 0; c < 2; ++c) {
      Eight base, rise;
      load(row.base[c].data() + i, base);
      load(row.rise[c].data() + i, rise);
      const Eight value = base + rise * of_right;
      std::memcpy(sharp[c].data() + i, &value, sizeof value);
    }
  }
  Eight total{};
  for (std::size_t i = 0; i < RenderedRow::kOut; i += kEight) {
    Eight scale, base, rise, of_right, weight;
    load(row.scale.data() + i, scale);
    load(row.luma_base.data() + i, base);
    load(row.luma_rise.data() + i, rise);
    load(right.data() + i + RenderedRow::kBlurReach, of_right);
    load(row.weight.data() + i, weight);
    Eight sum{};
    compare(base + rise * of_right, row.luma.data() + i, scale, sum);
    for (std::size_t c = 0; c < 2; ++c) {
      Eight picture{};
      for (std::size_t k = 0; k < row.blur.size(); ++k) {
        Eight value;
        load(sharp[c].data() + i + k, value);
        picture += row.blur[k] * value;
      }
      compare(picture, row.chroma[c].data() + i, scale, sum);
    }
    total += weight * sum;
  }
  float out = 0;
  for (std::size_t i = 0; i < kEight; ++i) out += total[i];
  return out;
}

float unlike_portable(const RenderedRow& row, float column_px) {
  return unlike_body(row, column_px);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] float unlike_avx2(const RenderedRow& row, float column_px) {
  return unlike_body(row, column_px);
}
#endif

}  // namespace

const std::vector<RowComparison>& row_comparisons() {
  static const std::vector<RowComparison> all = [] {
    std::vector<RowComparison> out{{"portable", unlike_portable}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", unlike_avx2});
#endif
    return out;
  }();
  return all;
}

}  // namespace relievo
