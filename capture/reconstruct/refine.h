// SPDX-License-Identifier: Apache-2.0
// Where exactly a decoded boundary lies. Analog video and YUV cameras carry colour at a fraction of luma's
// bandwidth, so the zero crossings of R, G and B are blurred and, beside a depth step, shifted; the step in
// luma is not. Knowing the code, both are used.
#pragma once

#include <array>

#include "base/image.h"
#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Whether two lines of a field under one slide show the same surface around `column_px`: it looks the same,
/// but for boundaries, which lean little. False outside the picture.
bool same_surface(View8 slide, int line, int other, float column_px);

class Refiner {
 public:
  /// `colour_matrix` must have an inverse: luma is that of the captured colours, not of the calibrated ones.
  explicit Refiner(const std::array<double, 9>& colour_matrix);

  /// Moves the columns of the decoded edges and sets their standard deviations and contrasts. `colours` are
  /// those on both sides of each boundary, under the slide that `image` shows; `slide` is the field under
  /// that slide itself, a row a line.
  void refine(const DifferenceImage& image, View8 slide, const SequenceResult& result,
              const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges);

  struct Sides {
    float free_left_px, free_right_px;  // to the next edges
    std::array<Primary, 2> colours;     // left and right, under the slide that the image shows
    bool narrow = false;                // there may be less than two pixels of a surface
  };
  struct Place {
    float column_px;
    float sigma_px;
    bool found;
    bool visible;  // luma differs enough between the two colours: where nothing is found, nothing is there
  };
  /// Whether and where luma shows a boundary near `column_px`, in the frame refined last. Any thread.
  Place find(const DifferenceImage& image, int line, float column_px, const Sides& sides) const;

 private:
  /// Where luma has the boundary.
  struct LumaPlace {
    float column_px;
    float slope;     // of the ratio, a pixel
    float rise;      // from the left level to the right one
    float contrast;  // of the scene in white light, near enough to spoil the place
    bool found;
  };
  /// Standard deviations of what blurred chroma does to zero crossings.
  struct Drawn {
    float always_px, by_contrast_px;
  };
  float projected_share(const DifferenceImage& image, const SequenceResult& result,
                        const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges) const;
  struct Light;
  Light light_around(const DifferenceImage& image, int line, int centre) const;
  static int clear_run(const Light& light, int centre, int step, int reach);
  LumaPlace luma_place(const DifferenceImage& image, int line, const Sides& sides, float share,
                       float own) const;
  float luma_sigma(const DifferenceImage& image, int line, const LumaPlace& luma) const;
  Drawn colour_drawn(const DifferenceImage& image, const EdgeImage& edges);
  void look_around(const DifferenceImage& image, int line, Edge& edge) const;
  void refine_edge(const DifferenceImage& image, int line, const LumaPlace& luma, const Drawn& drawn,
                   Edge& edge) const;

  std::array<float, 3> luma_;      // of the difference image's channels
  std::array<float, 8> ratio_;     // of each primary
  bool wide_stripes_ = false;      // in the last frame, so wide that two dark pixels are speckle
  float share_ = 1;                // projected_share of the last frame
  std::vector<LumaPlace> places_;  // one an edge
  std::vector<float> always_, by_contrast_;
};

}  // namespace relievo
