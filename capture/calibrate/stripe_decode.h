// SPDX-License-Identifier: Apache-2.0
// The system's own stripes on a scene that holds still, along columns and along rows of the projector: where
// their boundaries cross the camera's picture. For calibration.
//
// Stripes along rows are the same code turned: a picture of them is decoded by the ordinary decoder
// (capture/reconstruct) after exchanging its columns and rows.
#pragma once

#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/calibrate/local_homography.h"

namespace relievo {

/// Pictures under one slide and under its complement: RGB, whole frames, of one size.
struct StripePair {
  Image8 lit;
  Image8 complement;
};

struct StripeStack {
  int projector_width = 0, projector_height = 0;
  Pattern pattern;                  // along columns; along rows it is row_pattern() of it
  std::vector<StripePair> columns;  // [slide]
  std::vector<StripePair> rows;     // [slide]
  bool of_fields = false;           // each pair from a frame of an interlaced camera

  int width() const { return columns.empty() ? 0 : columns.front().lit.width(); }
  int height() const { return columns.empty() ? 0 : columns.front().lit.height(); }
};

/// The pattern along rows: as many first stripes of `pattern` as make stripes of its width fit the height.
/// N stripes divide the height as the contract has them divide the width.
Pattern row_pattern(const Pattern& pattern, int projector_width, int projector_height);

/// A stack of pairs in any order, such as a camera sees them go by: those with stripes along columns and
/// along rows are told apart by their pictures, and slides by their code. Fails where there are not as many
/// of each as the pattern has slides, and as decode_stripes().
Result<StripeStack> sort_stripes(std::vector<StripePair> pairs, const Pattern& pattern, int projector_width,
                                 int projector_height, const CameraColours& colours, WorkerPool& pool);

/// The boundaries of both axes. The slides may come in any order: the code tells them apart. Fails where the
/// stack is not one or two slides of each axis in pictures of one size, or hardly a boundary is decoded.
Result<ProjectorEdges> decode_stripes(const StripeStack& stack, const CameraColours& colours,
                                      WorkerPool& pool);

}  // namespace relievo
