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

void StripeGrid::reset(int boundaries_, int lines_, int step_bits_, bool twice_) {
  boundaries = boundaries_;
  lines = lines_;
  twice = twice_;
  step_bits = step_bits_;
  const std::size_t size = at(lines, 0);
  columns.assign(size, kAbsent);
  cells.assign(size, 0);
  sigmas.clear();
  interpolated.clear();
  vertices = 0;
  triangles = 0;
}

bool joins_halves(const StripeGrid& grid) {
  if (!grid.twice) return false;
  const auto begin = grid.cells.begin() + static_cast<std::ptrdiff_t>(grid.at(grid.picture_lines() - 1, 0));
  return std::any_of(begin, begin + grid.boundaries, [](std::uint8_t cell) { return cell != 0; });
}

std::vector<std::size_t> copies_of(const StripeGrid& grid) {
  std::vector<std::size_t> copies;
  const std::size_t second = grid.at(grid.picture_lines(), 0), apart = second - grid.at(0, 0);
  for (std::size_t i = second; i < grid.columns.size(); ++i)
    if (grid.columns[i] != StripeGrid::kAbsent && grid.columns[i] == grid.columns[i - apart])
      copies.push_back(i);
  return copies;
}

void keep_copies(std::span<const std::size_t> copies, StripeGrid& grid,
                 std::vector<std::uint8_t>& tolerance) {
  const std::size_t apart = grid.at(grid.picture_lines(), 0) - grid.at(0, 0);
  for (const std::size_t copy : copies) {
    grid.columns[copy] = grid.columns[copy - apart];
    if (!grid.sigmas.empty()) grid.sigmas[copy] = grid.sigmas[copy - apart];
    if (!tolerance.empty()) tolerance[copy] = tolerance[copy - apart] = 0;
  }
}

float sigma_of_rounded_px(float sigma_px, float step_px) {
  return sigma_px > 0 ? std::sqrt(sigma_px * sigma_px + step_px * step_px * (1.F / 12)) : 0;
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
