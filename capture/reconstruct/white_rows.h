// SPDX-License-Identifier: Apache-2.0
// The loops of the texture in white light (white_texture.h) over every sample. As rows.h: a portable
// reference, and others with the same results for what a processor can do beyond it.
#pragma once

#include <cstdint>
#include <vector>

namespace relievo {

/// One row of an interlaced picture and those beside it.
struct LitRows {
  const std::uint8_t *own, *field_above, *field_below;  // values of the row, and of the next of its own field
  const float *above, *below;                           // light of the rows beside it, of the other field
};

/// How much a row differs from each of two others; one entry before the first can be written, and one behind
/// the last.
struct RowDifferences {
  std::int16_t *above, *below;
};

struct WhiteKernels {
  const char* name;

  /// The other field's light in the row: between `above` and `below`, the nearer to the one whose field's row
  /// differs less from `own`, by the sum of three samples in a row; at the ends the last of them counts
  /// twice. `scratch` is overwritten.
  void (*other_field)(const LitRows& rows, int samples, const RowDifferences& scratch, float* out);

  /// out = a + b, rounded, 0 to 255.
  void (*store_sum)(const float* a, const float* b, int samples, std::uint8_t* out);
};

/// Those that run on this machine, the reference first and the best last.
const std::vector<WhiteKernels>& all_white_kernels();

/// The best that runs on this machine.
const WhiteKernels& white_kernels();

}  // namespace relievo
