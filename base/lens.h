// SPDX-License-Identifier: Apache-2.0
// Pixels and rays of a lens: the Brown-Conrady model of PinholeModel and its inverse. Pure; any thread.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "base/rig.h"

namespace relievo {

/// Normalised image coordinates (x/z, y/z) of a distorted pixel, by Newton's method on the Brown-Conrady
/// model. Nothing where the model has no inverse near the pixel (it folds over far outside what was
/// calibrated).
std::optional<std::array<double, 2>> undistort(const PinholeModel& model, double column_px, double row_px);

/// Distorted pixel of normalised image coordinates.
std::array<double, 2> distort(const PinholeModel& model, double x, double y);

/// x/z at which the light sheet through the distorted, normalised projector column `column` crosses height
/// y/z = y. NaN where the model folds over on the way there.
double sheet_at(const std::array<double, 5>& distortion, double column, double y);

/// The same camera with a picture of so many pixels; (0, 0) is the centre of the first one in either.
PinholeModel resized(const PinholeModel& model, int width, int height);

bool distorts(const PinholeModel& model);

/// Whether a number of a lens, or metres, may be a rig's: what is beyond goes in no stream. False of NaN.
inline bool fits_rig(double x) {
  return std::fabs(x) < 1e6;
}

/// Whether a lens has focal lengths of more than a pixel, as any that goes in a stream.
inline bool has_focal_lengths(const PinholeModel& model) {
  return model.fx() > 1 && model.fy() > 1;
}

}  // namespace relievo
