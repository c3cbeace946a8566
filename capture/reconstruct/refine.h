// SPDX-License-Identifier: Apache-2.0
// Where exactly a decoded boundary lies. Analog video and YUV cameras carry colour at a fraction of luma's
// bandwidth, so the zero crossings of R, G and B are blurred and, beside a depth step, shifted; the step in
// luma is not. Knowing the code, both are used.
#pragma once

#include <array>

#include "base/image.h"
#include "base/parallel.h"
#include "capture/reconstruct/colour_shift.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/luma_place.h"
#include "capture/reconstruct/place_scatter.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/sharp_luma.h"

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
  /// that slide itself, a row a line. `sharp`, of the same frame, places edges where the scene has contrast.
  void refine(const DifferenceImage& image, View8 slide, const SequenceResult& result,
              const std::vector<std::array<Primary, 2>>& colours, WorkerPool& pool, EdgeImage& edges,
              const SharpLuma* sharp = nullptr);

  /// Share of ambient light, 0..1, in what the field refined last shows where a stripe is lit.
  float ambient() const;
  /// Standard deviation of the blur of chroma over luma's, as the frames refined so far tell it.
  float blur_px() const { return ColourShift::kBlur_px[blur_]; }

  using Sides = LumaSides;
  struct Place {
    float column_px;
    float sigma_px;
    bool found;
    bool visible;  // luma differs enough between the two colours: where nothing is found, nothing is there
  };
  /// Whether and where luma shows a boundary near `column_px`, in the frame refined last. Any thread.
  Place find(const DifferenceImage& image, int line, float column_px, const Sides& sides) const;

 private:
  struct OnLine {
    int line;
    std::uint32_t edge;
  };
  /// Edges of a line that luma may place.
  struct Placing {
    std::vector<std::uint32_t> edges;
    std::vector<LumaQuery> queries;
    std::vector<LumaPlace> places;
  };
  struct Scratch {
    LumaLine light;  // of one line
    Placing plainly, sharply;
    std::vector<float> sharp_ratio;  // of the line's columns, and LumaView::kMargin more on both sides
    std::vector<OnLine> tell_blur;   // of all its lines
  };
  void look_at_line(const DifferenceImage& image, int line, const SequenceResult& result,
                    const std::vector<std::array<Primary, 2>>& colours, int worker, EdgeImage& edges);
  void place_sharply(int line, int width, Scratch& scratch) const;
  void look_at(const DifferenceImage& image, int line, const LumaLine& light, const LumaPlace& luma,
               bool sharp, Edge& edge, LumaSeen& out) const;
  static ShiftQuery shift_query(const DifferenceImage& image, int line, const SequenceResult& result,
                                const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges,
                                std::uint32_t e);
  void find_blur(const DifferenceImage& image, const SequenceResult& result,
                 const std::vector<std::array<Primary, 2>>& colours, const EdgeImage& edges,
                 WorkerPool& pool);
  static void refine_edge(const LumaSeen& luma, const ColourAndLumaErrors& errors, Edge& edge);

  LumaPlacer placer_;
  ColourShift shift_;
  std::size_t blur_ = 2;  // of chroma, of ColourShift::kBlur_px
  // What each would leave colour off luma, in pixels: summed, and of each edge that tells.
  using BlurCosts = std::array<float, ColourShift::kBlurs>;
  BlurCosts blur_cost_{};
  struct TellsBlur {
    int line;
    std::uint32_t edge;
    BlurCosts costs;
  };
  std::vector<TellsBlur> tell_blur_;
  bool wide_stripes_ = false;         // in the last frame, so wide that two dark pixels are speckle
  float share_ = 1;                   // of the projector in the last frame's light
  const SharpLuma* sharp_ = nullptr;  // of the frame being refined
  std::vector<Scratch> scratch_;      // one a worker
  std::vector<LumaSeen> seen_;        // one an edge
  PlaceScatter scatter_;
};

}  // namespace relievo
