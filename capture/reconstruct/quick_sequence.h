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
  const QuickImage* other = nullptr;
  const QuickImage* same = nullptr;
  const std::vector<ColumnRange>* expected = nullptr;
  float other_share = 0.5F;
};

/// An edge: where it is, the root of the sum of its channels' squared slopes, in units of the difference a
/// pixel, and what the column in the middle of each side shows.
struct QuickEdge {
  float column_px, slope;
  std::uint16_t left, right;  // these columns
  std::uint8_t code;          // signs: bits 3 to 5 are the left's channels, 0 to 2 the right's
  bool clear;                 // none is in doubt
};

/// A line's, from left to right.
struct QuickLine {
  const QuickEdge* edges;
  std::int16_t* boundary;  // of each: its index in the pattern, or -1
  std::uint8_t* still;     // of each: in the last frame under the same slide it was where it is
  std::uint8_t* settled;   // of each: no search was needed
  int count;

  /// How far to each side of an edge colours belong to it: a little more than half the way to the next one.
  float left_reach_px(int i) const;
  float right_reach_px(int i) const;
};

/// Constant after construction but for the edges and scratch memory. One thread.
class QuickSequence {
 public:
  explicit QuickSequence(const Pattern& pattern);

  /// Makes `image` of a frame and finds its edges, as EdgeFinder::find(); returns how many.
  std::size_t find_edges(const DetectionLines& rows, QuickDifferencer& differencer, WorkerPool& pool,
                         QuickImage& image);

  /// Of the edges found last in `image`.
  SequenceCounts decode(const QuickImage& image, const QuickContext& context, WorkerPool& pool);

  /// The edges found last, as they were decoded last.
  QuickLine line(int l) {
    const std::size_t at = static_cast<std::size_t>(l) * most_on_line_;
    return {edges_.data() + at, boundary_.data() + at, still_.data() + at, settled_.data() + at,
            static_cast<int>(line_start_[static_cast<std::size_t>(l) + 1] -
                             line_start_[static_cast<std::size_t>(l)])};
  }
  /// How many edges all lines before line l have, and behind the last line all; see for_shares().
  const std::vector<std::uint32_t>& line_start() const { return line_start_; }

  /// Colours to the left and right of each boundary, under the slide that the newer frame shows.
  const std::vector<std::array<Primary, 2>>& shown_colours(SlideOrder order) const {
    return slides_[order == SlideOrder::kNewerIsFirst ? 0 : 1].colours;
  }

 private:
  /// An edge between settled ones: what is seen beside it.
  struct Beside {
    SideEvidence left, right, other_left, other_right;
    bool tracked;
  };
  struct Scratch {
    std::vector<Crossing> crossings;
    std::vector<QuickPlace> places;
    std::vector<Beside> beside;  // of edges that are not settled
    PathCandidates candidates;   // of a stretch
    std::size_t in_order = 0, unsupported = 0, completed = 0;
  };

  const SlideColours& shown_slide(const QuickContext& c) const {
    return slides_[c.order == SlideOrder::kNewerIsFirst ? 0 : 1];
  }
  std::uint32_t edges_of_line(const QuickImage& image, int line, Scratch& scratch);
  void settle(const QuickContext& context, int line, const QuickLine& edges) const;
  static Beside look_beside(const QuickImage& image, const QuickContext& context, int line,
                            const QuickLine& edges, int edge);
  static float searched_px(const QuickImage& image, int line, const QuickEdge& edge);
  void search(const QuickContext& context, const QuickLine& line, int before, int behind, Scratch& scratch);
  struct Gain {
    float left, right, all;  // of its own frame's sides, and with the other slide's
  };
  Gain gain(const QuickContext& context, const Beside& beside, int boundary) const;
  bool convincing(const QuickContext& context, const Beside& beside, int boundary) const;
  void decode_line(const QuickImage& image, const QuickContext& context, int line, Scratch& scratch);
  const float* seen_px(int line) const {
    return seen_px_.data() + static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries_);
  }
  void drop_unsupported(int line, int lines, Scratch& scratch);
  void complete(const QuickImage& image, const QuickContext& context, int line, Scratch& scratch);

  /// Boundaries by the colours beside them alone, as QuickEdge::code has them.
  struct OfPair {
    std::array<std::uint32_t, 65> start{};
    std::vector<std::int16_t> boundary;
  };
  static OfPair of_pairs(const SlideColours& slide);
  int likely(const QuickContext& context, const QuickLine& line, int edge, const Beside& beside,
             std::int32_t* boundary, float* gains) const;

  std::array<SlideColours, 2> slides_;
  std::array<OfPair, 2> of_pair_;
  int boundaries_;
  std::size_t most_on_line_ = 0;
  std::vector<QuickEdge> edges_;  // [line][most_on_line_], as what follows
  std::vector<std::int16_t> boundary_;
  std::vector<std::uint8_t> still_, settled_;
  std::vector<std::uint32_t> line_start_;
  std::vector<Scratch> scratch_;
  std::vector<float> seen_px_;  // [line][boundary]: where the line has it, NaN: nowhere
};

}  // namespace relievo
