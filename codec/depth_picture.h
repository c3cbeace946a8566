// SPDX-License-Identifier: Apache-2.0
// A surface as the depths that a camera sees at its pixels.
#pragma once

#include <cstddef>
#include <vector>

#include "base/frame3d.h"
#include "base/rig.h"

namespace relievo {

/// z at each pixel's centre, metres, of the nearest triangle; infinite where there is none. The lens's
/// distortion counts at the corners: triangles are straight in the picture. One thread.
class DepthPicture {
 public:
  explicit DepthPicture(const PinholeModel& camera);

  /// Over what is there. Triangles with a corner behind the camera are left out.
  void draw(const Surface& surface);
  void clear();

  /// Row by row.
  double at(std::size_t pixel) const { return z_m_[pixel]; }
  std::size_t size() const { return z_m_.size(); }

 private:
  struct Corner {
    double column, row, inverse_z;  // 0 and less: behind the camera
  };
  Corner seen(const Vec3f& p) const;
  void draw(const Corner& a, const Corner& b, const Corner& c);

  PinholeModel camera_;
  std::vector<double> z_m_;
  std::vector<Corner> corners_;
};

}  // namespace relievo
