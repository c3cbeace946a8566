// SPDX-License-Identifier: Apache-2.0
// How flat and how large a calibrated rig finds the board: its corners triangulated, against a plane and
// against their true distances. The board's own pose is not used, so this is what a user of the rig will get.
#pragma once

#include <vector>

#include "capture/calibrate/bundle.h"

namespace relievo {

struct PlaneCheck {
  std::size_t corners = 0, lengths = 0;
  double plane_rms_m = 0;   // distance of triangulated corners from the plane fitted to them
  double length_rms_m = 0;  // error of the distance between neighbouring corners
  double scale_error = 0;   // the board's size against its true one, relative; above 0: too large
};

PlaneCheck check_plane(const Rig& rig, const BoardView& view);

/// RMS over all corners, lengths and sizes of several views.
PlaneCheck together(const std::vector<PlaneCheck>& checks);

}  // namespace relievo
