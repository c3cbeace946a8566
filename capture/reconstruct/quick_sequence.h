// SPDX-License-Identifier: Apache-2.0
// The quick decoder's edges, and which projected boundary each is: as edges.h and sequence.h, for live use.
// What the signs of all channels under both slides tell, and the edge beside agrees with, is settled at once;
// the path search along the line is left for what lies between.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/line_path.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// The frames before, as far as there are any; see SequenceContext.
struct QuickContext {
  SlideOrder order{};
  const QuadImage* other = nullptr;
  const QuadImage* same = nullptr;
  const std::vector<ColumnRange>* expected = nullptr;
  float other_share = 0.5F;
};

/// Constant after construction but for the edges and scratch memory. One thread.
class QuickSequence {
 public:
  explicit QuickSequence(const Pattern& pattern);

  /// Makes `image` of `frame` and finds its edges, as EdgeFinder::find(); returns how many.
  std::size_t find_edges(const CapturedFrame& frame, QuickDifferencer& differencer, WorkerPool& pool,
                         QuadImage& image);

  /// Of the edges found last in `image`. Of each Edge only the place, its standard deviation, the slope and
  /// the reach are set, and of `out` what later stages need: boundary, doubted, still and counts.
  void decode(const QuadImage& image, const QuickContext& context, WorkerPool& pool, EdgeImage& edges,
              SequenceResult& out);

  /// Colours to the left and right of each boundary, under the slide that the newer frame shows.
  const std::vector<std::array<Primary, 2>>& shown_colours(SlideOrder order) const {
    return slides_[order == SlideOrder::kNewerIsFirst ? 0 : 1].colours;
  }

 private:
  struct Found {
    float column_px, slope;
    QuadSpans spans;
    std::uint8_t code;  // QuadSides' of the frame that it was found in
    bool clear;
  };
  /// An edge between settled ones: what is seen beside it.
  struct Beside {
    SideEvidence left, right, other_left, other_right;
    bool tracked;
  };
  struct Scratch {
    std::vector<Crossing> crossings;
    std::vector<QuickPlace> places;
    std::vector<QuadSpans> spans;  // of one line's edges
    std::vector<QuadSides> sides;  // and what another frame shows there
    std::vector<std::int16_t> boundary;
    std::vector<std::uint8_t> settled;
    std::vector<Beside> beside;       // of edges that are not
    PathCandidates candidates;        // of a stretch
    std::vector<std::uint8_t> taken;  // one a boundary: a line has it
    std::size_t in_order = 0, unsupported = 0, completed = 0;
  };
  /// One line at work.
  struct Line {
    int line;
    const Found* found;
    int count;
  };

  const Found* found_on(int line) const {
    return found_.data() + static_cast<std::size_t>(line) * most_on_line_;
  }
  Found* found_on(int line) { return found_.data() + static_cast<std::size_t>(line) * most_on_line_; }
  const SlideColours& shown_slide(const QuickContext& c) const {
    return slides_[c.order == SlideOrder::kNewerIsFirst ? 0 : 1];
  }
  std::uint32_t edges_of_line(const QuadImage& image, int line, Scratch& scratch);
  void look_at_sides(const QuadImage& image, int line, std::uint32_t count, Scratch& scratch);
  void settle(const QuickContext& context, const Line& line, Scratch& scratch) const;
  static Beside look_beside(const QuadImage& image, const QuickContext& context, int line,
                            const QuadSpans& spans);
  void search(const QuickContext& context, const Line& line, int before, int behind, Scratch& scratch);
  struct Gain {
    float left, right, all;  // of its own frame's sides, and with the other slide's
  };
  Gain gain(const QuickContext& context, const Beside& beside, int boundary) const;
  bool convincing(const QuickContext& context, const Beside& beside, int boundary) const;
  void write_edges(const QuadImage& image, const Line& line, const Scratch& scratch, EdgeImage& edges,
                   SequenceResult& out);
  void drop_unsupported(int line, const EdgeImage& edges, Scratch& scratch, SequenceResult& out) const;
  void complete(const QuadImage& image, const QuickContext& context, int line, const EdgeImage& edges,
                Scratch& scratch, SequenceResult& out) const;

  std::array<SlideColours, 2> slides_;
  int boundaries_;
  std::size_t most_on_line_ = 0;
  std::vector<Found> found_;  // [line][most_on_line_]
  std::vector<std::uint32_t> line_start_;
  std::vector<Scratch> scratch_;
  std::vector<float> seen_px_;         // [line][boundary]: where the line has it, NaN: nowhere
  std::vector<std::uint8_t> settled_;  // one an edge
};

}  // namespace relievo
