// SPDX-License-Identifier: Apache-2.0
#include "codec/stripe_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/line_step.h"

namespace relievo {
namespace {

constexpr int kLargestCode = 63;
constexpr float kSmallest_px = 1e-4F;
constexpr float kStepsPerOctave = 4;

template <typename T>
T rounded(const T& values) {
  T out{};
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = static_cast<double>(static_cast<float>(values[i]));
  return out;
}
PinholeModel rounded(const PinholeModel& model) {
  return {model.width, model.height, rounded(model.matrix), rounded(model.distortion)};
}
}  // namespace

GridCalibration grid_calibration(const Rig& rig, const Pattern& pattern) {
  GridCalibration out;
  out.camera = rounded(rig.camera);
  out.projector = rounded(rig.projector);
  out.projector_from_camera_rotation = rounded(rig.projector_from_camera_rotation);
  out.projector_from_camera_translation = rounded(rig.projector_from_camera_translation);
  out.stripes = pattern.stripes();
  out.line_step_px = relievo::line_step_px(rig.scan);
  return out;
}

bool GridCalibration::operator==(const GridCalibration& other) const {
  const auto same = [](const PinholeModel& a, const PinholeModel& b) {
    return a.width == b.width && a.height == b.height && a.matrix == b.matrix && a.distortion == b.distortion;
  };
  return same(camera, other.camera) && same(projector, other.projector) && stripes == other.stripes &&
         line_step_px == other.line_step_px &&
         projector_from_camera_rotation == other.projector_from_camera_rotation &&
         projector_from_camera_translation == other.projector_from_camera_translation;
}

void StripeGrid::reset(int boundaries_, int lines_, int step_bits_) {
  boundaries = boundaries_;
  lines = lines_;
  step_bits = step_bits_;
  const std::size_t size = at(lines, 0);
  columns.assign(size, kAbsent);
  cells.assign(size, 0);
  sigmas.clear();
  interpolated.clear();
  vertices = 0;
  triangles = 0;
}

/// By the bits of the number: its octave, and which quarter of it.
std::uint8_t sigma_px_code(float sigma_px) {
  if (!(sigma_px > 0)) return 0;
  constexpr float kEighth = 1.0905077F;  // of an octave: rounds to the nearest
  const auto bits = std::bit_cast<std::uint32_t>(sigma_px * (kEighth / kSmallest_px));
  const std::uint32_t part = bits & 0x7fffffU;
  const auto octave = static_cast<int>(bits >> 23) - 127;
  const int quarter = (part >= 0x1837f0U) + (part >= 0x3504f3U) + (part >= 0x5744fdU);
  return static_cast<std::uint8_t>(
      1 + std::clamp(static_cast<int>(kStepsPerOctave) * octave + quarter, 0, kLargestCode - 1));
}

float sigma_px_of_code(std::uint8_t code) {
  return code == 0 ? 0 : kSmallest_px * std::exp2(static_cast<float>(code - 1) / kStepsPerOctave);
}

}  // namespace relievo
