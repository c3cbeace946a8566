// SPDX-License-Identifier: Apache-2.0
// The calibrated rig: a camera, a projector and the pose between them, as in a take's rig.yaml. Plain data.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace relievo {

/// How the two exposures of a frame lie in the camera's pictures. What is projected meanwhile: Scheme.
enum class Scan {
  kInterlaced,   // one picture a frame, its two fields exposed one after the other (see FieldOrder)
  kProgressive,  // two pictures a frame
};

/// Which field of an interlaced frame is exposed first, and so shows the slide.
enum class FieldOrder {
  kTop,     // rows 0, 2, ...
  kBottom,  // rows 1, 3, ...
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

/// Where a camera stands: X_world = rotation * X_camera + translation.
struct CameraPose {
  std::array<double, 9> rotation{};     // row-major
  std::array<double, 3> translation{};  // metres
};

/// What a camera's values tell of the projector's colours (paper 4.4).
struct CameraColours {
  /// Row-major; M of Eq. 1: projected RGB = M * light.
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  /// Captured = 255 (light / 255)^(1 / gamma), channel by channel; 1: captured is light.
  double gamma = 1;
};

struct Rig {
  Scan scan = Scan::kInterlaced;
  FieldOrder field_order = FieldOrder::kTop;  // of an interlaced scan
  double frame_rate = 0;                      // frames (field pairs) a second
  PinholeModel camera;
  PinholeModel projector;
  // X_projector = rotation * X_camera + translation, metres
  std::array<double, 9> projector_from_camera_rotation{};     // row-major
  std::array<double, 3> projector_from_camera_translation{};  // metres
  // As CameraColours has them.
  std::array<double, 9> colour_matrix{};
  double camera_gamma = 1;
  // How good its calibration found it; 0: not said.
  double stereo_rms_px = 0;  // what the board's corners are off by in either picture
  double scale_error = 0;    // what sizes and depths are wrong by, relative, where the board was
  // In a frame that it shares with other rigs, as whoever set them up has measured it; none: not said.
  std::optional<CameraPose> world_from_camera;
};

/// "interlaced" or "progressive".
std::string_view to_string(Scan scan);
/// "top" or "bottom".
std::string_view to_string(FieldOrder order);

CameraColours colours_of(const Rig& rig);
void set_colours(const CameraColours& colours, Rig& rig);

/// Whether the rows of a row-major 3x3 matrix are orthonormal, within 1e-4, and right-handed.
bool is_rotation(const std::array<double, 9>& matrix);

/// The text of a rig.yaml (OpenCV FileStorage), with every digit needed to read the same doubles back.
std::string to_yaml(const Rig& rig);

}  // namespace relievo
