// SPDX-License-Identifier: Apache-2.0
// What scoring found out about one frame, point by point: for pictures.
#pragma once

#include <vector>

namespace relievo {

/// A place where the camera sees a lit boundary.
struct JudgedBoundary {
  int row = 0;
  float column_px = 0;
  bool found = false;
};
/// A vertex, in the order of the surface's. Behind the camera: not listed.
struct JudgedVertex {
  float column_px = 0;
  float row_px = 0;
  float error = 0;  // of depth, signed, as a part of the true depth; where `right`
  bool right = false;
};
struct Judgement {
  std::vector<JudgedBoundary> boundaries;
  std::vector<JudgedVertex> vertices;
};

}  // namespace relievo
