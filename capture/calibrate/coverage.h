// SPDX-License-Identifier: Apache-2.0
// What the views of a calibration show together, and what is still missing: for whoever holds the board.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/rig.h"
#include "capture/calibrate/measure_view.h"

namespace relievo {

/// One thread.
class Coverage {
 public:
  /// Sizes in pixels; the camera's focal length where known, else 0 and a usual one is taken.
  Coverage(const PinholeModel& camera, const PinholeModel& projector);

  /// True where the board lies almost as in a view that was added.
  bool repeats(const MeasuredView& view) const;

  /// Counts the view and says what it shows: "63 corners, its left side 25 degrees farther away".
  std::string add(const MeasuredView& view);

  /// "the board in the top left and bottom right of the picture; its upper side farther away"; empty where
  /// nothing is.
  std::string missing() const;

  /// Where the board would help most, one place and one tilt: "in the top left of the picture, nearer, so
  /// that its upper side is farther away by some 25 degrees"; empty where nothing is missing.
  std::string next() const;

  /// The sides that were farther away in a view, of left, right, upper and lower.
  std::vector<std::string> tilts() const;

  /// RGB, camera left, projector right: where corners were seen, the last view's boldly; parts of the
  /// camera's picture without any are red. For who writes beside it what it shows.
  Image8 draw_seen() const;
  /// The same with words; below, the four tilts, those still missing in red.
  Image8 draw() const;

 private:
  PinholeModel camera_, projector_;
  std::array<bool, 9> cells_{};  // of the picture, row by row, that had a corner
  std::array<bool, 4> tilts_{};  // left, right, upper, lower side farther away
  /// How much of the picture's width the last view's corners span.
  double last_width() const;

  std::vector<std::vector<CornerSight>> added_;
};

}  // namespace relievo
