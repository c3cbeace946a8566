// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/colour_shift_rows.h"

#include "capture/reconstruct/eight.h"
#include "capture/reconstruct/stripe_end.h"

namespace relievo {
namespace {

constexpr std::size_t kEight = 8;

RELIEVO_INLINE void blur(const StripedRow::In& in, const StripedRow::Kernel& kernel, Eight& out) {
  out = Eight{};
  for (std::size_t k = 0; k < kernel.size(); ++k) {
    Eight value;
    load(in.data() + k, value);
    out += kernel[k] * value;
  }
}

RELIEVO_INLINE void differences_body(const StripedRow& row, std::array<StripedRow::Out, 3>& out) {
  const Eight steps = {0, 1, 2, 3, 4, 5, 6, 7};
  std::array<StripedRow::In, 3> light;  // of each channel: the surface's brightness, of the stripes' signs
  StripedRow::In luma;
  for (std::size_t i = 0; i < StripedRow::kIn; i += kEight) {
    const Eight column = steps + (row.first_px + static_cast<float>(i));
    Eight right, left_end, beyond_right, white;
    behind_end(column - row.column_px, right);
    behind_end(column - row.left_end_px, left_end);
    behind_end(column - row.right_end_px, beyond_right);
    load(row.white.data() + i, white);
    const Eight beyond_left = 1 - left_end;
    Eight all{};
    for (std::size_t q = 0; q < 3; ++q) {
      const auto& [l, r, ll, rr] = row.signs[q];
      const Eight shown = white * (l + (r - l) * right + (ll - l) * beyond_left + (rr - r) * beyond_right);
      store(shown, light[q].data() + i);
      all += row.luma[q] * shown;
    }
    store(all, luma.data() + i);
  }
  // Luma is not blurred, but by the low-pass along a line.
  Eight before, here, after, blurred;
  load(luma.data() + StripedRow::kReach - 1, before);
  load(luma.data() + StripedRow::kReach, here);
  load(luma.data() + StripedRow::kReach + 1, after);
  blur(luma, *row.blur, blurred);
  const Eight sharper = 0.25F * (before + 2 * here + after) - blurred;
  for (std::size_t q = 0; q < 3; ++q) {
    if (row.signs[q][StripedRow::kLeft] == row.signs[q][StripedRow::kRight]) continue;
    blur(light[q], *row.blur, blurred);
    store(blurred + row.grey[q] * sharper, out[q].data());
  }
}

void differences_portable(const StripedRow& row, std::array<StripedRow::Out, 3>& out) {
  differences_body(row, out);
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void differences_avx2(const StripedRow& row, std::array<StripedRow::Out, 3>& out) {
  differences_body(row, out);
}
#endif

}  // namespace

const std::vector<BlurKernel>& blur_kernels() {
  static const std::vector<BlurKernel> all = [] {
    std::vector<BlurKernel> out{{"portable", differences_portable}};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", differences_avx2});
#endif
    return out;
  }();
  return all;
}

}  // namespace relievo
