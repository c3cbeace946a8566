// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/sharp_luma.h"

#include <algorithm>

namespace relievo {
namespace {

/// Rec. 601, of the captured colours.
float luma(const std::uint8_t* rgb) {
  return 0.299F * static_cast<float>(rgb[0]) + 0.587F * static_cast<float>(rgb[1]) +
         0.114F * static_cast<float>(rgb[2]);
}

}  // namespace

SharpLuma::SharpLuma(const CapturedFrame& frame)
    : own_(frame.picture.view()),
      other_(frame.complement.view()),
      interlaced_(frame.scan == Scan::kInterlaced),
      sign_(1) {
  if (!interlaced_) return;
  own_ = frame.picture.view().field(0);
  other_ = frame.picture.view().field(1);
  if (frame.field_order == FieldOrder::kBottom) sign_ = -1;
}

void SharpLuma::ratio(int line, int first, int count, float dark, float* ratio) const {
  std::fill_n(ratio, count, 0.F);
  for (int l = line - 1; l <= line + 1; ++l) {
    const float weight = sign_ * (l == line ? 0.5F : 0.25F);
    const int here = std::clamp(l, 0, own_.height - 1);
    // An interlaced picture's other rows lie half a line off: their mean is what they show at this row.
    const int before = std::max(0, interlaced_ ? here - 1 : here);
    const std::uint8_t* lit = own_.row(here) + 3 * first;
    const std::uint8_t* above = other_.row(std::min(before, other_.height - 1)) + 3 * first;
    const std::uint8_t* below = other_.row(std::min(here, other_.height - 1)) + 3 * first;
    for (int i = 0; i < count; ++i) {
      const float a = luma(lit + 3 * i);
      const float b = 0.5F * (luma(above + 3 * i) + luma(below + 3 * i));
      ratio[i] += weight * (a - b) / (a + b + dark);
    }
  }
}

}  // namespace relievo
