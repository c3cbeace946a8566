// SPDX-License-Identifier: Apache-2.0
// What somebody who sets up a rig needs to know of one frame: exposure, how surely each colour is told, where
// stripes are found and where they do not fit together. No truth is needed. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/frame3d.h"
#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/source/field_source.h"

namespace relievo {

inline constexpr int kExposureBins = 64;  // of 4 grey levels each
inline constexpr int kClippedLevel = 250;
inline constexpr int kDarkLevel = 16;

/// Of both exposures of a frame.
struct ExposureCheck {
  std::array<std::array<std::uint64_t, kExposureBins>, 3> histogram{};  // by channel: pixels
  double clipped = 0;  // share of pixels with a channel at kClippedLevel or above in either exposure
  double dark = 0;     // share of pixels with no channel at kDarkLevel or above in either
};

/// How far the weakest channel of a stripe's middle is on its right side of zero in the difference image, in
/// levels of the paper's normalised scale: below 0 it is read wrong; colours count above 20 (5.2.2).
struct ColourMargin {
  Primary colour = 0;
  std::size_t stripes = 0;  // pieces of a stripe, one a line, that were looked at; 0: the rest says nothing
  float median = 0;
  float low = 0;     // 95 of 100 have more
  double wrong = 0;  // share below 0
};

struct OrderError {
  int line;         // of the field
  float column_px;  // between two boundaries, whose colours do not fit together
};

struct RigCheck {
  ExposureCheck exposure;
  std::optional<int> slide;              // that the frame shows, from 0; nothing where none was decoded
  std::vector<ColourMargin> margins;     // one a colour of the palette, in its order
  float noise = 0;                       // standard deviation of the difference image, on the margins' scale
  std::size_t boundaries = 0;            // seen in this frame, each for itself
  std::size_t neighbours = 0;            // pairs of them that should fit together
  std::vector<OrderError> order_errors;  // the pairs that do not
  std::size_t lit_px = 0;                // pixels of lines that the pattern's light changes
  std::size_t covered_px = 0;            // of which within half a stripe of a decoded boundary
  Image8 cover;                          // grey, a row a line: 0 not lit, 1 lit, 2 lit and covered

  double coverage() const {
    return lit_px == 0 ? 0 : static_cast<double>(covered_px) / static_cast<double>(lit_px);
  }
};

/// `frame` as the camera gave it.
ExposureCheck check_exposure(const CapturedFrame& frame);

/// `captured` as the camera gave it; `decoded` is what was made of it (Reconstructor::decoded()), in light,
/// and `grid` where boundaries were found in that.
RigCheck check_rig(const CapturedFrame& captured, const CapturedFrame& decoded,
                   const std::vector<GridPoint>& grid, const Rig& rig, const Pattern& pattern);

/// The exposure under the slide; clipped pixels in red, dark ones in blue.
Image8 draw_exposure(const CapturedFrame& captured);
/// Over the dimmed frame: green where stripes are decoded, red where their light arrives and they are not.
Image8 draw_coverage(const CapturedFrame& decoded, const RigCheck& check);
/// Over the dimmed frame: magenta where neighbouring boundaries do not fit together.
Image8 draw_order(const CapturedFrame& decoded, const RigCheck& check);

}  // namespace relievo
