// SPDX-License-Identifier: Apache-2.0
// Decoded boundaries followed from line to line. A boundary hardly changes its place over a few lines, so
// where it is known there, what it should look like here is known too: averaged along it, evidence suffices
// that is too weak on one line alone or that speckle hides there.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Keeps its scratch memory from frame to frame. One thread.
class Tracer {
 public:
  /// Adds edges to `edges` and their boundaries to `result`, and moves edges.
  /// `image` is what the edges were found in; `sequence` and `context` are what decoded them.
  std::size_t trace(const DifferenceImage& image, const SequenceDecoder& sequence,
                    const SequenceContext& context, WorkerPool& pool, SequenceResult& result,
                    EdgeImage& edges);

 private:
  struct Added {
    int line;
    std::int16_t boundary;
    Edge edge;
  };
  struct Place {
    float column_px, slope_px;  // slope: pixels a line
  };
  struct Scratch {
    std::vector<Added> added;
    std::vector<float> columns;  // of one boundary: one a line, NaN where there is none
  };
  void trace_boundary(const DifferenceImage& image, int boundary, const SequenceDecoder& sequence,
                      const SequenceContext& context, Scratch& scratch) const;
  void merge_line(int line, const SequenceResult& result, const EdgeImage& edges);
  void insert(WorkerPool& pool, SequenceResult& result, EdgeImage& edges);
  float spacing(int line, int boundary, int side) const;

  int boundaries_ = 0;
  int lines_ = 0;
  std::vector<float> column_;  // [boundary][line]: of the edge, or NaN
  std::vector<Scratch> scratch_;
  std::vector<Added> added_;
  EdgeImage merged_;
  std::vector<std::int16_t> merged_boundary_;
  std::vector<std::uint8_t> merged_still_;
};

}  // namespace relievo
