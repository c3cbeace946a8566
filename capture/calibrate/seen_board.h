// SPDX-License-Identifier: Apache-2.0
// What a simulated camera sees of a board at one pose, under any light of the projector.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/rig.h"
#include "capture/calibrate/board_surface.h"
#include "capture/calibrate/bundle.h"
#include "capture/camera_response.h"
#include "capture/pattern/gray_code.h"
#include "capture/source/sim/stripe_light.h"

namespace relievo {

struct BoardSceneOptions {
  double noise = 1.2;     // sigma, of 255
  double ambient = 0.04;  // light that is not the projector's, of its white
  double chroma = 0;      // sigma of the chroma blur along a line, camera pixels; of colour pictures
  double exposure = 1;    // times the one that suits a white board
  int samples = 2;        // a pixel is the mean of samples * samples rays
  std::uint32_t seed = 1;
};

/// A slide of stripes and the axis they lie along.
struct StripeSlide {
  const sim::StripeLight* light = nullptr;
  bool along_rows = false;
  bool complement = false;
};

/// Traced once, then lit as often as wanted. Immutable: any thread. Same input, same bytes.
class SeenBoard {
 public:
  SeenBoard(const Rig& rig, const BoardSurface& surface, const Pose& camera_from_board, int samples);

  /// One channel.
  Image8 under(const GraySlide& slide, const BoardSceneOptions& options) const;
  /// RGB, with the crosstalk of the rig's colour matrix.
  Image8 under(const StripeSlide& slide, const BoardSceneOptions& options) const;

 private:
  /// What one ray of a camera pixel meets.
  struct Sample {
    float column, row;  // projector pixels
    float albedo;
  };
  void trace_row(const BoardSurface& surface, const Pose& camera_from_board, int y);
  bool lit(const Sample& sample) const;
  float reach(std::size_t pixel, bool along_rows) const;

  Rig rig_;
  CameraResponse response_;
  std::size_t each_;  // samples a pixel
  int samples_;
  std::vector<Sample> traced_;
};

/// Rotation vector and translation of the rig's projector_from_camera.
Pose projector_pose(const Rig& rig);

/// Uniform and normal deviates, the same on every platform.
class SceneRandom {
 public:
  explicit SceneRandom(std::uint32_t seed);
  double uniform();  // in [0, 1)
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double normal();

 private:
  std::uint64_t state_;
};

/// `value` with noise as a camera's 8 bits.
std::uint8_t exposed(double value, double noise, const CameraResponse& response, SceneRandom& random);

/// Grey level of albedo 1 in the projector's white.
constexpr double kBoardExposure = 220;

}  // namespace relievo
