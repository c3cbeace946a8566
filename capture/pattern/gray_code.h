// SPDX-License-Identifier: Apache-2.0
// The static Gray-code scheme: columns and rows of the projector, one bit a slide, each followed by its
// inverse. For bring-up, calibration and ground truth, where the scene stands still. Pure functions; any
// thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/image.h"

namespace relievo {

enum class GrayAxis { kColumns, kRows };

/// One projected picture.
struct GraySlide {
  enum class Kind { kBit, kWhite, kBlack };
  Kind kind = Kind::kBit;
  GrayAxis axis = GrayAxis::kColumns;
  int bit = 0;           // of the Gray code, 0 the finest
  bool inverse = false;  // white where the bit is 0
};

/// Bits that tell `count` (1..16384) columns or rows apart.
int gray_bits(int count);

constexpr std::uint32_t gray_from_binary(std::uint32_t value) {
  return value ^ (value >> 1);
}
constexpr std::uint32_t binary_from_gray(std::uint32_t code) {
  for (unsigned shift = 16; shift > 0; shift /= 2) code ^= code >> shift;
  return code;
}

/// The bit that flips between positions `left` and `left` + 1: one bit only, which is what makes the code
/// Gray.
int gray_bit_between(int left);

/// Every slide in the order of projection: the bits of the columns, coarsest first, each before its inverse;
/// those of the rows; white; black. 2 * (column bits + row bits) + 2 slides.
std::vector<GraySlide> gray_slides(int projector_width, int projector_height);

/// One channel, 0 or 255.
Image8 draw_gray_slide(const GraySlide& slide, int projector_width, int projector_height);

/// "column bit 9, inverse", for messages.
std::string to_string(const GraySlide& slide);

}  // namespace relievo
