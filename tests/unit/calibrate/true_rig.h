// SPDX-License-Identifier: Apache-2.0
// A rig of known truth for calibration tests, and calibrating against it.
#pragma once

#include <cmath>
#include <vector>

#include "capture/calibrate/geometry.h"

namespace relievo {

inline Rig truth() {
  Rig rig;
  rig.scan = Scan::kInterlaced;
  rig.frame_rate = 29.97;
  rig.camera = {640, 480, {1050, 0, 325, 0, 1052, 236, 0, 0, 1}, {-0.18, 0.1, 0.0006, -0.0008, 0}};
  // A projector that throws upwards: its principal point lies below its picture.
  rig.projector = {800, 600, {1250, 0, 398, 0, 1251, 660, 0, 0, 1}, {-0.04, 0.05, 0.0008, 0.0005, 0}};
  const double a = 0.2, b = 0.28;  // towards the camera's axis, and down by the lens shift
  const std::array<double, 9> y = {std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a)};
  const std::array<double, 9> x = {1, 0, 0, 0, std::cos(b), -std::sin(b), 0, std::sin(b), std::cos(b)};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k) sum += x[3 * i + k] * y[3 * k + j];
      rig.projector_from_camera_rotation[3 * i + j] = sum;
    }
  }
  rig.projector_from_camera_translation = {-0.2, 0.01, 0.05};
  rig.colour_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  return rig;
}

inline PinholeModel size_of(const PinholeModel& lens) {
  PinholeModel out;
  out.width = lens.width;
  out.height = lens.height;
  return out;
}

inline Result<Geometry> calibrate(const Rig& rig, const std::vector<MeasuredView>& views) {
  return calibrate_geometry(views, size_of(rig.camera), size_of(rig.projector), {});
}

inline Rig rig_of(const Geometry& geometry) {
  return with_geometry(truth(), geometry);
}

}  // namespace relievo
