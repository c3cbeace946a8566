// SPDX-License-Identifier: Apache-2.0
// Slides seen one after the other in, decoded boundaries out (paper 5.2, 5.3): keeps the frames before that a
// code takes, finds out which slide each shows, and hands each frame to the decoder that was chosen.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "base/rig.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/reconstruct/second_places.h"
#include "capture/source/field_source.h"

namespace relievo {

/// What decode() is to decode.
struct SlideView {
  const CapturedFrame& pair;
  const std::vector<ColumnRange>* expected;  // of each boundary, from the depths before; null: not known
};

/// One stream's. One thread.
class SlideDecoder {
 public:
  /// `pattern` must be valid (check_pattern) and have one or two slides.
  SlideDecoder(const Rig& rig, const Pattern& pattern, const ReconstructOptions& options);
  SlideDecoder(SlideDecoder&&) noexcept;
  SlideDecoder& operator=(SlideDecoder&&) noexcept;
  ~SlideDecoder();

  /// Looks at a frame whose exposures are a slide and its complement. Sets report.boundaries and .same_slide.
  void observe(const CapturedFrame& pair, WorkerPool& pool, ReconstructReport& report);

  /// Decodes the frame observed last, which is `view.pair`, into `out`, a grid of the pattern's boundaries
  /// and the rig's lines whose points are left as they are; false while the other slide was not seen. Sets
  /// report.slide, .matched and .filters.
  bool decode(const SlideView& view, WorkerPool& pool, ReconstructReport& report, DecodedGrid& out);

  /// Of the frame that decode() was called for last, if it did: where things move, and the colours left and
  /// right of each boundary. Not of the paper's decoder. Until the next call.
  const MovingPlaces& moving() const;
  const std::vector<std::array<Primary, 2>>& shown_colours() const;

  /// What the lines of the frame that decode() was called for last show a second time. Until the next call.
  const std::vector<SecondPlace>& second_places() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace relievo
