// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/gray_beyond.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "capture/pattern/gray_code.h"

namespace relievo {
namespace {

constexpr std::size_t kNoise = 50;  // one clear pixel in so many may be read wrongly

int difference(const GrayPair& pair, std::size_t pixel) {
  return int{pair.lit.data()[pixel]} - int{pair.inverse.data()[pixel]};
}

/// The place that a pixel sees; -1 where a bit is not clear, as at edges.
int place(const std::vector<GrayPair>& pairs, std::size_t pixel, double clear) {
  std::uint32_t gray = 0;
  for (std::size_t bit = 0; bit < pairs.size(); ++bit) {
    const int d = difference(pairs[bit], pixel);
    if (std::abs(d) < clear) return -1;
    if (d > 0) gray |= 1u << bit;
  }
  return static_cast<int>(binary_from_gray(gray));
}

}  // namespace

std::string beyond_projector(const GrayStack& stack, const GrayDecodeOptions& options) {
  const std::size_t pixels =
      static_cast<std::size_t>(stack.width()) * static_cast<std::size_t>(stack.height());
  std::size_t seen = 0, beyond = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    int contrast = 0;
    for (const auto* pairs : {&stack.columns, &stack.rows})
      for (const GrayPair& pair : *pairs) contrast = std::max(contrast, std::abs(difference(pair, i)));
    if (contrast < options.min_contrast) continue;
    const double clear = std::max<double>(options.min_difference, options.min_share * contrast);
    const int column = place(stack.columns, i, clear), row = place(stack.rows, i, clear);
    if (column < 0 || row < 0) continue;
    ++seen;
    beyond += column >= stack.projector_width || row >= stack.projector_height;
  }
  if (kNoise * beyond <= seen) return {};
  return std::to_string(beyond) + " of " + std::to_string(seen) + " pixels see columns or rows outside of " +
         std::to_string(stack.projector_width) + "x" + std::to_string(stack.projector_height) +
         ": is --projector right, and are the pictures in the order of projection?";
}

}  // namespace relievo
