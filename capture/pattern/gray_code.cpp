// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/gray_code.h"

#include <algorithm>
#include <bit>

namespace relievo {

int gray_bits(int count) {
  return std::max(1, static_cast<int>(std::bit_width(static_cast<unsigned>(count - 1))));
}

int gray_bit_between(int left) {
  return std::countr_zero(static_cast<unsigned>(left + 1));
}

std::vector<GraySlide> gray_slides(int projector_width, int projector_height) {
  std::vector<GraySlide> slides;
  for (const GrayAxis axis : {GrayAxis::kColumns, GrayAxis::kRows}) {
    const int bits = gray_bits(axis == GrayAxis::kColumns ? projector_width : projector_height);
    for (int bit = bits - 1; bit >= 0; --bit) {
      slides.push_back({GraySlide::Kind::kBit, axis, bit, false});
      slides.push_back({GraySlide::Kind::kBit, axis, bit, true});
    }
  }
  slides.push_back({.kind = GraySlide::Kind::kWhite});
  slides.push_back({.kind = GraySlide::Kind::kBlack});
  return slides;
}

Image8 draw_gray_slide(const GraySlide& slide, int projector_width, int projector_height) {
  Image8 picture(projector_width, projector_height, 1);
  const auto lit = [&](int position) {
    if (slide.kind != GraySlide::Kind::kBit) return slide.kind == GraySlide::Kind::kWhite;
    const bool bit = (gray_from_binary(static_cast<std::uint32_t>(position)) >> slide.bit & 1u) != 0;
    return bit != slide.inverse;
  };
  for (int y = 0; y < projector_height; ++y) {
    std::uint8_t* row = picture.row(y);
    for (int x = 0; x < projector_width; ++x) {
      row[x] = lit(slide.axis == GrayAxis::kColumns ? x : y) ? 255 : 0;
    }
  }
  return picture;
}

std::string to_string(const GraySlide& slide) {
  if (slide.kind == GraySlide::Kind::kWhite) return "white";
  if (slide.kind == GraySlide::Kind::kBlack) return "black";
  return std::string(slide.axis == GrayAxis::kColumns ? "column" : "row") + " bit " +
         std::to_string(slide.bit) + (slide.inverse ? ", inverse" : "");
}

}  // namespace relievo
