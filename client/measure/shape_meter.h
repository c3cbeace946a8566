// SPDX-License-Identifier: Apache-2.0
// How exactly surfaces show a plane or a sphere that is known to be one, over many frames: what tells of a
// rig how good it is (VDI/VDE 2634 part 2 has such artefacts).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/frame3d.h"
#include "base/image.h"
#include "base/result.h"
#include "base/rig.h"
#include "client/measure/shape.h"
#include "codec/depth_picture.h"

namespace relievo {

/// Pixels of the rig camera's picture.
struct PictureRegion {
  int column = 0, row = 0, width = 0, height = 0;
};

/// The middle of the picture, .4 of it each way.
PictureRegion middle_region(const PinholeModel& camera);

/// Over frames.
struct Spread {
  double median = 0;
  double deviation = 0;  // standard; 0 of one frame
};

/// Lengths are in metres. Measured points alone count, none that are interpolated.
struct ShapeReport {
  std::uint64_t frames = 0;
  std::uint64_t without_shape = 0;  // frames in which too few points lay in the region, or on no one shape
  Spread points;                    // in the region
  Spread off;     // share of them more than five robust deviations away: they count no further
  Spread rms_m;   // of the points' heights over the shape of their own frame
  Spread span_m;  // that .997 of them lie within
  std::optional<Spread>
      expected_m;   // what rms_m would be by the points' own standard deviations, where those are known
  Spread size_m;    // of a plane its depth at the region's middle, of a sphere its radius
  Spread tilt_deg;  // of a plane against the camera's axis
  std::array<Spread, 3> centre_m;  // of a sphere
  double filled = 0;               // share of the region's pixels with surface, mean of the frames
  double form_m = 0;  // RMS over pixels of each one's mean height: what more frames don't take away
  std::optional<double> noise_m;  // median over pixels of the standard deviation of their depths over frames
};

/// One thread.
class ShapeMeter {
 public:
  /// `region` lies in the camera's picture.
  ShapeMeter(const PinholeModel& camera, const PictureRegion& region, ShapeKind kind);

  /// Fails where the surface is broken.
  Status add(const Frame3D& frame);
  ShapeReport report() const;
  /// Each pixel's mean height over the shape: red before a plane or outside a sphere, blue behind or inside,
  /// full at `full_m`; grey where there is no surface. RGB, of the region's size.
  Image8 picture(double full_m) const;

 private:
  /// Of one pixel of the region, over frames.
  struct Pixel {
    std::uint64_t frames = 0;
    double height_m = 0;       // mean
    double depth_m = 0;        // mean
    double depth_squares = 0;  // sum of squares about that mean
  };
  struct Series {
    std::vector<double> points, off, rms_m, span_m, expected_m, size_m, tilt_deg;
    std::array<std::vector<double>, 3> centre_m;
  };
  void collect(const Surface& surface);
  void measure_heights(const Shape& shape);
  void measure_place(const Shape& shape);
  void measure_pixels(const Surface& surface, const Shape& shape);

  PinholeModel camera_;
  PictureRegion region_;
  ShapeKind kind_;
  DepthPicture depths_;
  std::vector<std::array<double, 2>> rays_;  // x/z and y/z of the region's pixels; NaN: none
  std::vector<Pixel> pixels_;
  Series series_;
  std::uint64_t without_shape_ = 0;
  std::uint64_t filled_ = 0;  // pixels, over all frames
  // Of the frame at hand: the region's points, and their standard deviations along z.
  std::vector<Vec3f> points_;
  std::vector<float> sigmas_m_;
  std::vector<double> heights_m_;
};

}  // namespace relievo
