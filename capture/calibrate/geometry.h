// SPDX-License-Identifier: Apache-2.0
// Geometric calibration of a rig from measured views of a board (measure_view.h): intrinsics and distortion
// of the camera and of the projector, which is treated as a camera that looks backwards, and the pose between
// them. OpenCV's calibrateCamera starts both lenses; a bundle adjustment (bundle.h) finishes.
#pragma once

#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/calibrate/bundle.h"
#include "capture/calibrate/measure_view.h"

namespace relievo {

struct GeometryOptions {
  BundlePriors priors;
  /// A view whose stereo RMS is over `bad_view` times the median of all and over `bad_view_px`, or over
  /// `stray_view` times it and `stray_view_px`, is left out, the worst first, while more than `min_views` are
  /// left. A corner off by more than `bad_corner` robust
  /// sigmas and `bad_corner_px` in either device is left out.
  double bad_view = 2.5;
  double bad_view_px = 0.5;
  double stray_view = 4;
  double stray_view_px =
      0.1;  // of views this clean, one far worse has a picture of another pose among its own
  double bad_corner = 5;
  double bad_corner_px = 1;
  std::size_t min_views = 3;
  double most_rms_px = 5;          // stereo RMS of a rig that can be used,
  double most_depth_sigma = 0.02;  // and depth_sigma_m of its distance_m
};

/// Pixels, but for the plane. An RMS is over distances in the picture, as cv::stereoCalibrate reports it.
struct ViewReport {
  std::string name;
  bool used = false;
  std::string why;  // it was left out
  std::size_t corners = 0;
  std::size_t corners_left_out = 0;
  double camera_rms = 0, projector_rms = 0, stereo_rms = 0;
  double plane_rms_m = 0;  // of the triangulated corners around their plane
};

/// A corner and how far from it the calibrated rig puts it, for a picture.
struct CornerResidual {
  std::size_t view = 0;
  Vec2d camera_px{}, camera_off_px{};
  Vec2d projector_px{}, projector_off_px{};
};

struct Geometry {
  PinholeModel camera, projector;
  std::array<double, 9> projector_from_camera_rotation{};
  std::array<double, 3> projector_from_camera_translation{};
  std::array<double, 8> sigma_px{};    // fx fy cx cy of camera, then of projector
  std::size_t views = 0, corners = 0;  // used
  double camera_rms = 0, projector_rms = 0, stereo_rms = 0;
  double stereo_rms_all = 0;  // with the corners that were left out of used views
  double distance_m = 0;      // median depth of the corners
  /// Standard deviation of a depth at that distance, from those of lenses and pose, RMS over the camera's
  /// picture where the projector reaches. Infinite where the views leave it open.
  double depth_sigma_m = 0;
  double plane_rms_m = 0;
  double square_error_m = 0;              // RMS of the distances between neighbouring triangulated corners
  double scale_error = 0;                 // RMS over the views of the board's size, relative
  std::vector<ViewReport> reports;        // every view, in the order given
  std::vector<CornerResidual> residuals;  // of used corners
};

/// The most of depth_sigma_m, as a share of distance_m, of a rig that is calibrated well: 1 mm a metre. Eight
/// views that differ have less than half of it, three may have more.
inline constexpr double kGoodDepthSigma = 1e-3;

/// Sizes are pixels of the two devices. Fails where fewer than `min_views` views can be used, or they do not
/// determine the rig or fit none; the error says which views that measuring did not refuse, and why.
Result<Geometry> calibrate_geometry(const std::vector<MeasuredView>& views, const PinholeModel& camera_size,
                                    const PinholeModel& projector_size, const GeometryOptions& options);

/// `rig` with the devices, their pose and the quality that were found: its scale_error is of the board's size
/// and of depths.
Rig with_geometry(Rig rig, const Geometry& geometry);

/// Residuals as arrows, 200 times as long, over the camera's picture (left) and the projector's (right). RGB.
Image8 draw_residuals(const Geometry& geometry);

}  // namespace relievo
