// SPDX-License-Identifier: Apache-2.0
// The loop in which capture/reconstruct/colour_shift.h spends its time: the difference of fields around a
// boundary as a camera that blurs colour shows it. As rows.h: a portable reference, and others with the same
// results for what a processor can do beyond it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace relievo {

/// The stripes around a boundary, on a surface of some brightness.
struct StripedRow {
  static constexpr int kReach = 7;  // of a kernel to each side
  static constexpr std::size_t kTaps = 2 * kReach + 1;
  static constexpr std::size_t kOut = 8;
  static constexpr std::size_t kColumns = kOut + 2 * kReach;  // that these depend on
  static constexpr std::size_t kIn = 24;                      // whole vectors of them
  using In = std::array<float, kIn>;
  using Out = std::array<float, kOut>;
  using Kernel = std::array<float, kTaps>;
  enum Stripe : std::uint8_t { kLeft, kRight, kBeyondLeft, kBeyondRight };

  In white{};      // brightness
  float first_px;  // column of the first of In; that of the first of Out is kReach further on
  float column_px, left_end_px, right_end_px;  // of the boundary, and where the stripes beside it end
  std::array<std::array<float, 4>, 3> signs;   // of each channel in each stripe: -1 or 1
  std::array<float, 3> luma;                   // weights of the channels in luma
  std::array<float, 3> grey;                   // what each channel shows of a grey that the camera sees
  const Kernel* blur;                          // of colour, and the low-pass along a line
};

/// Each of `name` gives, of the channels whose sign is another left and right of the boundary, the difference
/// as it is shown; others are left as they are.
struct BlurKernel {
  const char* name;
  void (*differences)(const StripedRow& row, std::array<StripedRow::Out, 3>& out);
};

/// Those that run on this machine, the portable one first and the best last.
const std::vector<BlurKernel>& blur_kernels();

}  // namespace relievo
