// SPDX-License-Identifier: Apache-2.0
// The loop in which capture/reconstruct/render_place.h spends its time: a row of a picture with a boundary at
// a place, against the row that is shown. One portable implementation, and others for what a processor can do
// beyond it; all give the same results.
#pragma once

#include <array>
#include <vector>

namespace relievo {

/// What the camera shows about a boundary, but for where that is: all of it is linear in the share of light
/// that is the right stripe's.
struct RenderedRow {
  static constexpr int kReach_px = 5;   // to each side of the place as it was
  static constexpr int kBlurReach = 5;  // of the blur of chroma
  static constexpr int kColumns = 2 * kReach_px + 1;
  static constexpr int kRead = kColumns + 2 * kBlurReach;  // columns that these depend on
  static constexpr std::size_t kOut = 16;                  // whole vectors of both
  static constexpr std::size_t kIn = 32;
  using In = std::array<float, kIn>;
  using Out = std::array<float, kOut>;

  float first_px = 0;  // column of the first that is read; that of the first of Out is kBlurReach further on
  std::array<In, 2> base{}, rise{};  // red and blue less luma, not blurred: without, and of, the right stripe
  Out luma_base{}, luma_rise{};
  Out luma{};                   // as shown,
  std::array<Out, 2> chroma{};  // and red and blue less luma
  Out scale{};                  // one over what is much
  Out weight{};                 // of each column; 0 beyond kColumns
  std::array<float, 2 * kBlurReach + 1> blur{};
};

/// Each of `name` gives, of the row with the boundary at a column, how unlike what is shown it is: 0..3 a
/// column, times its weight.
struct RowComparison {
  const char* name;
  float (*unlike)(const RenderedRow& row, float column_px);
};

/// Those that run on this machine, the portable one first and the best last.
const std::vector<RowComparison>& row_comparisons();

}  // namespace relievo
