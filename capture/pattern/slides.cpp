// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/slides.h"

#include <algorithm>
#include <cstdint>

namespace relievo {
namespace {

void draw_row(const Pattern& pattern, int slide, bool complement, int width, std::uint8_t* row) {
  for (int x = 0; x < width; ++x) {
    // Stripe whose share of the width holds x + 1/2, in integers.
    const auto stripe =
        static_cast<int>((2 * static_cast<std::int64_t>(x) + 1) * pattern.stripes() / (2 * width));
    const Primary colour = pattern.colour(stripe, slide);
    const int lit = complement ? colour ^ 7 : colour;
    for (int c = 0; c < 3; ++c) row[3 * x + c] = (lit >> c) & 1 ? 255 : 0;
  }
}

}  // namespace

Image8 draw_slide(const Pattern& pattern, int slide, bool complement, int width, int height) {
  Image8 out(width, height, 3);
  draw_row(pattern, slide, complement, width, out.row(0));
  for (int y = 1; y < height; ++y) std::copy_n(out.row(0), out.stride(), out.row(y));
  return out;
}

Image8 draw_row_slide(const Pattern& pattern, int slide, bool complement, int width, int height) {
  Image8 line(height, 1, 3);
  draw_row(pattern, slide, complement, height, line.row(0));
  Image8 out(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) std::copy_n(line.row(0) + 3 * y, 3, out.row(y) + 3 * x);
  }
  return out;
}

Image8 draw_field(const Pattern& pattern, const Exposure& exposure, int width, int height) {
  if (exposure.light != Light::kWhite)
    return draw_slide(pattern, exposure.slide, exposure.light == Light::kComplement, width, height);
  Image8 out(width, height, 3);
  std::fill_n(out.data(), out.size(), std::uint8_t{255});
  return out;
}

Image8 draw_interlaced(const Pattern& pattern, int frame, FieldOrder order, int width, int height) {
  Image8 out(width, height, 3);
  for (const int half : {0, 1}) {
    const Image8 field =
        draw_field(pattern, shown(pattern, static_cast<std::uint64_t>(frame), half), width, 1);
    for (int y = first_row(order, half); y < height; y += 2)
      std::copy_n(field.row(0), field.stride(), out.row(y));
  }
  return out;
}

}  // namespace relievo
