// SPDX-License-Identifier: Apache-2.0
// The calibrated rig: a camera, a projector and the pose between them, as in a take's rig.yaml. Plain data.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace relievo {

/// How the two exposures of a frame lie in the camera's pictures.
enum class Scan {
  kInterlaced,   // one picture a frame: even rows under the slide, odd rows under its complement
  kProgressive,  // two pictures a frame: the first under the slide, the second under its complement
};

/// A pinhole with the Brown-Conrady distortion k1 k2 p1 p2 k3 (OpenCV's order).
struct PinholeModel {
  int width = 0;                       // pixels
  int height = 0;                      // pixels
  std::array<double, 9> matrix{};      // row-major 3x3, pixels; centre of the first pixel is (0, 0)
  std::array<double, 5> distortion{};  // k1 k2 p1 p2 k3

  double fx() const { return matrix[0]; }
  double fy() const { return matrix[4]; }
  double cx() const { return matrix[2]; }
  double cy() const { return matrix[5]; }
};

struct Rig {
  Scan scan = Scan::kInterlaced;
  double frame_rate = 0;  // frames (field pairs) a second
  PinholeModel camera;
  PinholeModel projector;
  // X_projector = rotation * X_camera + translation, metres
  std::array<double, 9> projector_from_camera_rotation{};     // row-major
  std::array<double, 3> projector_from_camera_translation{};  // metres
  std::array<double, 9> colour_matrix{};  // row-major; M of Eq. 1: projected RGB = M * captured RGB
};

/// "interlaced" or "progressive".
std::string_view to_string(Scan scan);

/// The text of a rig.yaml (OpenCV FileStorage), with every digit needed to read the same doubles back.
std::string to_yaml(const Rig& rig);

}  // namespace relievo
