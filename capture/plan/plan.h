// SPDX-License-Identifier: Apache-2.0
// What a rig will see before it is built: field of view, stripes in the picture, how exact depths can be,
// what blur and motion leave of that, and how many stripes to project (docs/RIG.md). Formulas of ideal
// optics: lens distortion is left out. All functions are pure; any thread.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"

namespace relievo {

/// A camera and a projector beside it (to its right, as the camera looks), both without distortion.
struct RigSketch {
  Scan scan = Scan::kInterlaced;
  double frame_rate = 29.97;  // field pairs a second
  int camera_width = 640, camera_height = 480;
  double camera_view_rad = 0.594;  // horizontal field of view
  int projector_width = 1024, projector_height = 768;
  double projector_view_rad = 0.659;  // horizontal
  double baseline_m = 0.2;
  double distance_m = 1.0;  // where both optical axes cross
};

/// Fails where a size, an angle (0 to 170 degrees) or a distance is none.
Result<Rig> sketch_rig(const RigSketch& sketch);

/// How well a surface and the optics keep the stripes.
struct PlanConditions {
  double near_m = 0.8, distance_m = 1.0, far_m = 1.25;  // camera's z; in this order
  double level = 180;              // of 255: what the projector's white adds to the surface's picture
  double noise = 1.2;              // standard deviation of a pixel's channel, of 255
  double camera_blur_px = 1.0;     // sigma of lens, chroma and everything else in the camera, camera pixels
  double projector_blur_px = 0.7;  // sigma of the projector's, projector pixels
  double camera_aperture_m = 0;    // diameter of the pupil; 0: focus is taken as perfect over the depths
  double projector_aperture_m = 0;
  double exposure_s = 0;  // of a field; 0: the whole field's time
  double speed_m_s = 0;   // fastest motion, in any direction
};

/// A plane across the camera's axis.
struct PlanAtDepth {
  double depth_m = 0;
  double view_width_m = 0, view_height_m = 0;  // of the camera
  double lit = 0;                              // share of the camera's picture that the projector reaches
  double stripe_px = 0;                        // width of a stripe in the picture, median of the middle row
  double stripe_m = 0;                         // and on the plane
  double metres_per_px = 0;    // depth that a pixel's step along the line changes, at the centre
  double blur_px = 0;          // sigma of an edge, camera pixels: lenses, focus, pixel, motion
  double focus_blur_px = 0;    // of which focus
  double motion_blur_px = 0;   // way during one exposure, whole width, of motion across the picture
  double motion_frame_px = 0;  // way of a stripe from one frame to the next, of motion in depth
  double bound_px = 0;         // least standard deviation of a boundary's column, by one line (Cramer-Rao)
  double sigma_px = 0;         // expected of the default decoder, within a factor of two
  double sigma_m = 0;          // and of the depth
};

/// Depths about the working distance between which no other boundary of the same look can be seen in one
/// place.
struct DepthSpan {
  double near_m = 0;
  std::optional<double> far_m;  // nothing: to infinity
};

struct Plan {
  std::array<PlanAtDepth, 3> at;  // near, working distance, far
  bool unique = false;            // slides decoded together: each boundary's code is unique over the picture
  DepthSpan one_boundary;         // where one slide alone is to be believed, from a single boundary
  DepthSpan three_boundaries;     // and from three in a row
  int recommended_stripes = 0;
  std::vector<std::string> warnings;  // each a sentence with what to do
};

// Measured of the default decoder (docs/RIG.md): it takes neighbouring lines together, and where there is
// hardly any noise an error remains.
constexpr double kSigmaOfBound = 0.35;
constexpr double kSigmaFloor_px = 0.003;

/// The narrowest stripe, in camera pixels, that is decoded as completely as wider ones (docs/RIG.md).
constexpr double kNarrowestStripe_px = 5;

/// `pattern` with its stripes over the rig's projector. Fails where depths or conditions are out of order or
/// the projector and camera do not see one place.
Result<Plan> make_plan(const Rig& rig, const Pattern& pattern, const PlanConditions& conditions);

}  // namespace relievo
