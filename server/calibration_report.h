// SPDX-License-Identifier: Apache-2.0
// What calibrations say of their results, as JSON: of the command line and of the page /rig.
#pragma once

#include <string>

#include "capture/calibrate/colour.h"
#include "capture/calibrate/geometry.h"

namespace relievo {

/// One object.
std::string colour_report(const ColourCalibration& calibration);
std::string geometry_report(const Geometry& geometry);

}  // namespace relievo
