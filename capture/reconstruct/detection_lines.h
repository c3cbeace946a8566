// SPDX-License-Identifier: Apache-2.0
// The rows of a frame that are detection lines. Line l is row 2 l * stride of an interlaced picture,
// whichever field was first, and row l * stride of a progressive one.
#pragma once

#include <algorithm>

#include "base/image.h"
#include "base/line_step.h"
#include "base/rig.h"
#include "capture/source/field_source.h"

namespace relievo {

/// `stride` is 1, 2 or 4, as ReconstructOptions::line_stride.
inline int line_count(const Rig& rig, int stride) {
  const int step = line_step_px(rig.scan, stride);
  return (rig.camera.height + step - 1) / step;
}

/// Refers to the frame it was made of.
struct DetectionLines {
  View8 own, other;  // the exposure on the lines, and the other one
  float below = 0;   // so many lines below lie the other's rows, and as many above: a line's mean of two
  bool shows_slide = true;  // `own` does, and `other` the complement; or the other way round

  DetectionLines(const CapturedFrame& frame, int stride = 1)
      : own(frame.picture.view()), other(frame.complement.view()), step_(stride) {
    if (frame.scan == Scan::kInterlaced) {
      other = own.field(1);
      own = own.field(0);
      below = 0.5F / static_cast<float>(stride);
      shows_slide = frame.field_order == FieldOrder::kTop;
    }
    all_other_ = other;
    for (int left = stride; left > 1; left /= 2) {
      own = own.field(0);
      other = other.field(0);
    }
  }

  View8 slide() const { return shows_slide ? own : other; }
  View8 complement() const { return shows_slide ? other : own; }
  /// Of own less other: slide less complement.
  int sign() const { return shows_slide ? 1 : -1; }
  /// The other exposure's rows whose mean lies on line l. It must have one.
  const std::uint8_t* other_above(int l) const {
    const int row = step_ * l;
    return all_other_.row(std::clamp(below > 0 ? row - 1 : row, 0, all_other_.height - 1));
  }
  const std::uint8_t* other_below(int l) const {
    return all_other_.row(std::min(step_ * l, all_other_.height - 1));
  }

 private:
  View8 all_other_;  // also those of its rows that are beside no line
  int step_;
};

}  // namespace relievo
