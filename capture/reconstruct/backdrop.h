// SPDX-License-Identifier: Apache-2.0
// What stands still, remembered: where each boundary was and how the picture looked there. What comes from
// behind something that moves looks again as it did, and is known to the colour before two slides have shown
// it; what looks otherwise is covered.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "capture/reconstruct/slide_field.h"

namespace relievo {

/// Keeps 20 bytes a boundary and line. One thread.
class Backdrop {
 public:
  Backdrop(int boundaries, int lines);

  /// Of a boundary that stands still in this field.
  void remember(const SlideFieldView& view, int line, int boundary, float column_px);

  /// Where the boundary was last seen to stand still, NaN where it never was.
  float column_px(int line, int boundary) const { return seen(line, boundary).column_px; }

  /// From there to the next boundary, or from the one before; NaN where neither was seen.
  float pitch_px(int line, int boundary) const;

  /// True where it is at that place.
  bool stands(int line, int boundary, float column_px) const;

  /// How unlike the picture around a place is to what it was around the boundary under this slide, 0..1;
  /// nothing where that is not known.
  std::optional<float> difference(const SlideFieldView& view, int line, int boundary, float column_px) const;

 private:
  using Look = std::array<std::uint8_t, 6>;  // RGB left and right of it
  struct Seen {
    float column_px;
    std::array<bool, 2> has;  // by slide
    std::array<Look, 2> look;
  };
  static std::optional<Look> look_at(View8 field, int line, float column_px);
  const Seen& seen(int line, int boundary) const {
    return seen_[static_cast<std::size_t>(line) * boundaries_ + static_cast<std::size_t>(boundary)];
  }

  std::size_t boundaries_;
  std::vector<Seen> seen_;  // [line][boundary]
};

}  // namespace relievo
