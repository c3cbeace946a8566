// SPDX-License-Identifier: Apache-2.0
// Stripe edges of one frame with everything that can be said about them from that frame: for decoders that
// weigh evidence instead of deciding pixel by pixel.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/rows.h"

namespace relievo {

/// Three channels' difference beside an edge, in units in which 1 is clearly of that sign and the noise is
/// small.
using SideEvidence = std::array<float, 3>;

struct Edge {
  float column_px = 0;
  float sigma_px =
      0;  // standard deviation of column_px, from slope and noise (Cramer-Rao for the samples used)
  float noise_px = 0;  // the part of sigma_px that is noise; the rest is what the scene around it does
  float slope = 0;     // root of the sum of the channels' squared slopes, difference units a pixel
  float contrast = 0;  // 0..1, of the scene in white light around the edge: what draws an edge off its place
  bool at_step = false;        // the scene itself has a step just here: perhaps it is what was found
  bool above_differs = false;  // the scene has a step between this line and the one above,
  bool below_differs = false;  // or below: another surface, or its edge
  float left_reach_px = 0;  // how far to the left evidence was gathered, less than half way to the next edge
  float right_reach_px = 0;
  SideEvidence left{};  // of the frame the edge was found in
  SideEvidence right{};
};

struct EdgeImage {
  int lines = 0;
  std::vector<std::uint32_t>
      line_start;           // lines + 1 entries: edges of line l are [line_start[l], line_start[l + 1])
  std::vector<Edge> edges;  // by line, then left to right
};

struct EvidenceBeside {
  SideEvidence left, right;
};

/// Evidence of colours beside `column_px`, half a reach of `edge` to a whole one away, on a line of any
/// frame's difference image.
EvidenceBeside evidence_beside(const DifferenceImage& image, int line, const Edge& edge, float column_px);

/// The same for many edges of a line at once. Keeps its scratch memory. One thread.
class EdgeSides {
 public:
  /// Looks beside `count` edges.
  void look(const DifferenceImage& image, int line, const Edge* edges, std::size_t count);
  /// Looks beside the same edges again, in another image, `off_px` (one an edge) from their columns.
  void look_again(const DifferenceImage& image, int line, const Edge* edges, const float* off_px);
  /// Of the edges looked at last.
  const Sides& operator[](std::size_t i) const { return sides_[i]; }

 private:
  std::vector<SideWindows> windows_;
  std::vector<Sides> sides_;
};

/// Keeps its scratch memory from frame to frame. One thread.
class EdgeFinder {
 public:
  /// Zero crossings of at least one channel that stand out of the noise; crossings of several channels at one
  /// place are one edge, weighed by their slopes. `out` is overwritten; its memory is reused.
  void find(const DifferenceImage& image, WorkerPool& pool, EdgeImage& out);

 private:
  class Gatherer;
  struct Found {
    float column_px;
    float slope;
    float noise;  // of the difference there
  };
  struct Scratch {
    std::vector<std::uint8_t> flags;
    EdgeSides sides;
  };
  Found* found_on(int line) { return found_.data() + static_cast<std::size_t>(line) * most_on_line_; }
  static std::uint32_t crossings_of_line(const DifferenceImage& image, int line, Scratch& scratch,
                                         Found* found);
  static void make_edges(const DifferenceImage& image, int line, const Found* found, std::size_t count,
                         EdgeSides& sides, Edge* edges);

  std::size_t most_on_line_ = 0;
  std::vector<Found> found_;  // [line][most_on_line_]
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
