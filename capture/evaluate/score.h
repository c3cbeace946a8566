// SPDX-License-Identifier: Apache-2.0
// How good a reconstruction is, against a take's truth: which of the boundaries that the camera can see were
// found, how many points are wrong, and how exact the right ones are.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "base/frame3d.h"
#include "base/image.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/evaluate/judge.h"

namespace relievo {

/// Errors are of depth along the camera's z axis, in micrometres per metre of depth.
struct Score {
  std::size_t frames = 0;  // scored
  std::size_t of = 0;      // with truth and a slide other than the frame before's
  double vertices_per_frame = 0;
  double completeness =
      0;  // of the visible boundary pixels, those with a right vertex within 1.2 px along the line
  double outliers = 0;  // of the vertices, those over 2 % of depth off, or where nothing is
  /// Of the right vertices; NaN where there are none.
  double median_um_per_m = kNone, rms_um_per_m = kNone, p95_um_per_m = kNone;

 private:
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
};

/// The truth on even rows at the time of a frame's first field (0), as it is, or of its second (1): between
/// the odd rows above and below. Odd rows stay as they are.
ImageF truth_of_field(const ImageF& truth, int half);

/// The truth half way in time between two frames', of the same size; where they are of two surfaces, the
/// later one's.
ImageF truth_between(const ImageF& before, const ImageF& after);

/// Collects frames of one take. One thread.
class Scorer {
 public:
  Scorer(const Rig& rig, const Pattern& pattern);

  /// `truth` is depth in metres, camera height x width, 0 where there is nothing; `surface` null where the
  /// frame should have been reconstructed and was not. `judgement`, where given, is overwritten.
  void add(const ImageF& truth, const Surface* surface, Judgement* judgement = nullptr);
  Score score() const;

 private:
  struct Expected {
    int row;
    float column_px;
  };
  /// Where the camera sees lit boundaries: pixel pairs on one line whose stripes differ by one, away from
  /// depth steps.
  std::vector<Expected> expected(const ImageF& truth) const;

  Rig rig_;
  Pattern pattern_;
  std::vector<float> ray_x_, ray_y_;  // x/z, y/z of each camera pixel
  std::size_t frames_ = 0, of_ = 0, vertices_ = 0, right_ = 0, expected_ = 0, hit_ = 0;
  std::vector<float> errors_;  // relative, right vertices
};

}  // namespace relievo
