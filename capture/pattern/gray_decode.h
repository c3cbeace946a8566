// SPDX-License-Identifier: Apache-2.0
// Decodes a stack of Gray-code pictures: for each camera pixel the projector column and row it sees, to a
// fraction of a projector pixel.
//
// A bit is read from the sign of picture minus inverse, so that neither albedo nor ambient light needs a
// threshold. The finest detail is where that difference crosses zero: the edge between two projector columns,
// found to a fraction of a camera pixel. A pixel's column is a plane fitted to the edges around it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"
#include "base/result.h"
#include "capture/pattern/gray_code.h"

namespace relievo {

/// Pictures under one bit and under its inverse: grey, all of one size.
struct GrayPair {
  Image8 lit;
  Image8 inverse;
};

struct GrayStack {
  int projector_width = 0;
  int projector_height = 0;
  std::vector<GrayPair> columns;  // [bit], 0 the finest
  std::vector<GrayPair> rows;     // [bit]
  Image8 picture;                 // RGB of the scene in white light, registered to the pictures

  int width() const { return picture.width(); }
  int height() const { return picture.height(); }
};

struct GrayDecodeOptions {
  /// A pixel is lit by the projector where the largest difference of its pairs is at least this (of 255).
  int min_contrast = 30;
  /// A bit is clear where its difference is at least `min_difference` and this share of the pixel's contrast.
  /// A pixel counts where every bit of both axes is clear, but for one an axis whose two readings are
  /// neighbouring columns: an edge of the finest kind runs through the pixel.
  int min_difference = 3;
  double min_share = 0.05;
  /// Half the side of the window whose edges make a pixel's sub-pixel column; it grows up to four times where
  /// projector pixels are large in the picture. 0: whole columns only.
  int window_px = 3;
};

/// Where the edge between projector columns (or rows) floor(value) and floor(value) + 1 crosses the picture.
struct GrayEdge {
  float x = 0, y = 0;  // camera pixels
  float value = 0;     // n + 0.5
};

/// Edges of one axis, ordered by the pixel right of or below which they lie: those of pixel i are
/// edges[first[i]] to edges[first[i + 1]].
struct GrayEdges {
  std::vector<std::uint32_t> first;  // width * height + 1
  std::vector<GrayEdge> edges;
};

struct GrayMaps {
  ImageF columns, rows;  // of the camera's size: projector pixels; -1 where not decoded
  GrayEdges column_edges, row_edges;
  std::size_t lit = 0;        // pixels with enough contrast
  std::size_t decoded = 0;    // with a column and a row
  std::size_t uncertain = 0;  // lit, but a bit was not clear, or
  std::size_t beyond = 0;     // (of these) all were, and say a place outside of the projector
  std::size_t lone = 0;       // read clearly, but unlike everything around: counted as not decoded
};

/// Fails where the stack is empty, pictures differ in size, or there are too few bits for the projector.
/// Any number of threads gives the same result.
Result<GrayMaps> decode_gray(const GrayStack& stack, const GrayDecodeOptions& options, WorkerPool& pool);

/// Where more pixels than noise makes see places outside of the stack's projector, which was larger than is
/// said: a sentence that says so. Empty else. What they see inside fits as if all were well.
std::string beyond_projector(const GrayStack& stack, const GrayMaps& maps);

}  // namespace relievo
