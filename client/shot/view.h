// SPDX-License-Identifier: Apache-2.0
// From where a surface is drawn. World and view are camera frames: x right, y down, z forward, metres. Pure.
#pragma once

#include <array>

#include "base/frame3d.h"
#include "base/rig.h"

namespace relievo {

/// An eye: a pose and a lens.
struct ShotView {
  std::array<Vec3f, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // right, down, forward in the world
  Vec3f eye{};
  PinholeModel lens;  // pixels of the picture that is drawn

  Vec3f to_view(const Vec3f& point) const;
  Vec3f direction_to_view(const Vec3f& direction) const;
};

struct Orbit {
  double azimuth_deg = 16;    // the eye's, to the right of the rig's camera
  double elevation_deg = 13;  // above it
  double zoom = 1;            // 2: everything twice as large
  double fov_deg = 40;        // upright
};

struct Extent {
  Vec3f min{}, max{};
};

/// Of the finite positions; all 0 where there is none. Leaves out the farthest 1 % at each end of each axis,
/// so that a stray vertex does not make everything else small.
Extent extent_of(const std::vector<Vec3f>& positions);

/// Looks at the middle of `extent`, all of which is in the picture at zoom 1.
ShotView orbit_view(const Extent& extent, const Orbit& orbit, int width, int height);

/// What the rig's camera sees, lens distortion included, as large as it fits in the picture, centred.
ShotView rig_view(const PinholeModel& camera, int width, int height);

}  // namespace relievo
