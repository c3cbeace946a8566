// SPDX-License-Identifier: Apache-2.0
// Where the projector sees a corner that the camera found: the board is flat, so around the corner camera and
// projector pictures are tied by a homography (Moreno and Taubin, "Simple, accurate, and robust
// projector-camera calibration", 3DIMPVT 2012). It is fitted to the code's edges (Gray code or stripes), not
// to the whole columns of pixels, robustly.
#pragma once

#include <optional>

#include "capture/calibrate/board.h"
#include "capture/pattern/gray_decode.h"

namespace relievo {

/// Where edges between projector columns and rows cross a camera picture.
struct ProjectorEdges {
  int width = 0, height = 0;  // of the camera's picture
  GrayEdges columns, rows;
};

struct ProjectedCorner {
  Vec2d projector_px{};
  double rms_px = 0;  // of the edges around the fitted homography, projector pixels
  int edges = 0;      // that agree with it
};

/// The projector position of a camera point, from edges no farther than `radius_px`. Nothing where fewer than
/// 40 edges of either axis agree, or less than half of those there do, or they are not of three different
/// columns and rows at least.
std::optional<ProjectedCorner> project_corner(const ProjectorEdges& edges, Vec2d camera_px, double radius_px);

}  // namespace relievo
