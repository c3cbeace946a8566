// SPDX-License-Identifier: Apache-2.0
// A projected slide as light: its stripes integrated exactly over any interval of projector columns.
#pragma once

#include <array>
#include <vector>

#include "base/pattern.h"
#include "capture/source/sim/vec.h"

namespace relievo::sim {

/// One slide, its stripes blurred by a Gaussian (the projector's defocus). Its integral over an interval is
/// exact: no stripe is sampled. Outside the projector's columns the outermost stripes go on.
class StripeLight {
 public:
  /// slide in 0..pattern.slides - 1; defocus_px >= 0, the Gaussian's sigma in projector pixels.
  StripeLight(const Pattern& pattern, int slide, int projector_width, double defocus_px);

  /// Mean RGB, 0..1, over projector columns [u0, u1], either order. Pixel centres are at whole numbers.
  Vec3 mean(float u0, float u1) const;

 private:
  struct Node {
    float integral[3], value[3];
  };
  Vec3 integral(float u) const;  // of colour - 1/2, to keep the numbers small
  double exact(double u, int channel) const;

  int width_;
  double sigma_;
  std::vector<double> edges_;                  // columns of the boundaries
  std::vector<std::array<float, 3>> colours_;  // of each stripe
  std::vector<std::array<double, 3>>
      prefix_;               // integral of colour - 1/2 up to each stripe's left edge, unblurred
  std::vector<Node> nodes_;  // only where blurred: Hermite nodes 1/16 px apart
};

}  // namespace relievo::sim
