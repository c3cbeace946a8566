// SPDX-License-Identifier: Apache-2.0
// A camera's curve, taken out of its pictures and put back. Light adds up, and colours are mixed by a matrix
// (paper, Eq. 1), only where values are light; a camera's are not unless its gamma is switched off.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Of every channel alike: captured = 255 (light / 255)^(1 / gamma). Immutable: any thread.
class CameraResponse {
 public:
  static constexpr double kMostGamma = 3;

  /// `gamma` in 1..kMostGamma; 1: values are light.
  explicit CameraResponse(double gamma = 1);
  bool is_straight() const { return values_.empty(); }

  /// Of a captured value, 0..255.
  float light_of(std::uint8_t value) const { return light_[value]; }
  /// The value that a camera has for that, the nearest one; saturates.
  std::uint8_t value_of(float light) const {
    if (is_straight()) return static_cast<std::uint8_t>(std::clamp(light + 0.5F, 0.F, 255.F));
    return values_[static_cast<std::size_t>(std::clamp(light, 0.F, 255.F) * kParts + 0.5F)];
  }
  /// `samples` of a row.
  void light_of(const std::uint8_t* values, int samples, float* light) const;

  /// The frame in light: whole levels, as decoders read it. Memory of `out` is reused.
  void straighten(const CapturedFrame& captured, WorkerPool& pool, CapturedFrame& out) const;
  Image8 straightened(const Image8& captured) const;

 private:
  static constexpr int kParts = 256;  // of a grey level: a curve is steep where it is dark

  std::array<float, 256> light_{};
  std::array<std::uint8_t, 256> levels_{};  // the same, in whole levels
  std::vector<std::uint8_t> values_;        // by parts of light; empty: straight
};

/// A frame as the camera's values have it, and in light; twice the same where they are.
struct SeenFrame {
  const CapturedFrame& captured;
  const CapturedFrame& light;
};

}  // namespace relievo
