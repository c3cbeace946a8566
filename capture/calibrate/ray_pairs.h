// SPDX-License-Identifier: Apache-2.0
// Points from full correspondences: a camera pixel's ray and the ray of the projector pixel it sees. Two rays
// in space miss each other by a gap, which tells how good the decoding and the calibration are.
#pragma once

#include <optional>
#include <vector>

#include "base/image.h"
#include "base/rig.h"
#include "capture/calibrate/point_cloud.h"

namespace relievo {

struct RayMeeting {
  Vec3f point{};    // metres, camera frame: middle of the shortest line between the rays
  float gap_m = 0;  // its length
};

/// Where rays through undistorted normalised coordinates (x/z, y/z) of camera and projector come closest.
/// Nothing where that is behind either or the rays are parallel.
std::optional<RayMeeting> meet(const Rig& rig, std::array<double, 2> camera, std::array<double, 2> projector);

struct DensePoints {
  PointCloud cloud;          // metres, camera frame; coloured
  std::vector<float> gap_m;  // one a point
  std::size_t apart = 0;     // left out: the rays miss each other by more than the limit, or meet nowhere
};

/// A point for each pixel with a column and a row (both -1 where none). `picture`: RGB of the maps' size.
/// `max_gap_m` as above; 0 keeps all that meet.
DensePoints triangulate_maps(const Rig& rig, const ImageF& columns, const ImageF& rows, const Image8& picture,
                             double max_gap_m);

}  // namespace relievo
