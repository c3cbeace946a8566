// SPDX-License-Identifier: Apache-2.0
#include "base/rig.h"

#include <cmath>
#include <cstdio>
#include <span>

namespace relievo {
namespace {

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  std::string out = text;
  // FileStorage reads a bare integer as an int; the decimal point keeps it a real.
  if (out.find_first_of(".en") == std::string::npos) out += ".0";
  return out;
}

std::string matrix(std::string_view name, int rows, int cols, std::span<const double> values) {
  std::string out(name);
  out += ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: [ ";
  for (std::size_t i = 0; i < values.size(); ++i) out += (i ? ", " : "") + number(values[i]);
  return out + " ]\n";
}

std::string pinhole(const std::string& name, const PinholeModel& model) {
  return name + "_width: " + std::to_string(model.width) + "\n" + name +
         "_height: " + std::to_string(model.height) + "\n" + matrix(name + "_matrix", 3, 3, model.matrix) +
         matrix(name + "_distortion", 1, 5, model.distortion);
}

}  // namespace

std::string_view to_string(Scan scan) {
  return scan == Scan::kInterlaced ? "interlaced" : "progressive";
}

std::string_view to_string(FieldOrder order) {
  return order == FieldOrder::kTop ? "top" : "bottom";
}

CameraColours colours_of(const Rig& rig) {
  return {rig.colour_matrix, rig.camera_gamma};
}

void set_colours(const CameraColours& colours, Rig& rig) {
  rig.colour_matrix = colours.matrix;
  rig.camera_gamma = colours.gamma;
}

bool is_rotation(const std::array<double, 9>& m) {
  constexpr double kTolerance = 1e-4;
  const auto dot = [&](std::size_t i, std::size_t j) {
    return m[3 * i] * m[3 * j] + m[3 * i + 1] * m[3 * j + 1] + m[3 * i + 2] * m[3 * j + 2];
  };
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (!(std::abs(dot(i, j) - (i == j ? 1.0 : 0.0)) <= kTolerance)) return false;
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
             m[2] * (m[3] * m[7] - m[4] * m[6]) >
         0;
}

std::string to_yaml(const Rig& rig) {
  std::string out =
      "%YAML:1.0\n---\nscan: " + std::string(to_string(rig.scan)) +
      (rig.field_order == FieldOrder::kTop ? ""
                                           : "\nfield_order: " + std::string(to_string(rig.field_order))) +
      "\nframe_rate: " + number(rig.frame_rate) + "\n";
  out += pinhole("camera", rig.camera);
  out += pinhole("projector", rig.projector);
  out += matrix("projector_from_camera_rotation", 3, 3, rig.projector_from_camera_rotation);
  out += matrix("projector_from_camera_translation", 3, 1, rig.projector_from_camera_translation);
  out += matrix("colour_matrix", 3, 3, rig.colour_matrix);
  if (rig.camera_gamma != 1) out += "camera_gamma: " + number(rig.camera_gamma) + "\n";
  if (rig.stereo_rms_px > 0) out += "stereo_rms_px: " + number(rig.stereo_rms_px) + "\n";
  if (rig.scale_error > 0) out += "scale_error: " + number(rig.scale_error) + "\n";
  if (rig.world_from_camera) {
    out += matrix("world_from_camera_rotation", 3, 3, rig.world_from_camera->rotation);
    out += matrix("world_from_camera_translation", 3, 1, rig.world_from_camera->translation);
  }
  return out;
}

}  // namespace relievo
