// SPDX-License-Identifier: Apache-2.0
// Which projected boundary each edge is, from the order of the sequence. Beyond paper 5.3: boundaries come
// along a line in the order in which they were projected, so a line is decoded as a whole; and neighbouring
// lines see the same boundaries, so each line's result is checked and completed by the others'. One frame's
// colours and the order nearly suffice; the other slide's frame adds evidence where the scene held still, and
// cannot veto where it moved.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "base/pattern.h"
#include "capture/reconstruct/backdrop.h"
#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/line_path.h"
#include "capture/reconstruct/match.h"
#include "capture/reconstruct/seen_depths.h"

namespace relievo {

/// Every count is of edges.
struct SequenceCounts {
  std::size_t in_order = 0;     // decoded along their line
  std::size_t unsupported = 0;  // of which given up, since no neighbour agreed
  std::size_t completed = 0;    // decoded by the lines above and below
};

struct SequenceResult {
  std::vector<std::int16_t> boundary;  // one an edge: its index in the pattern, or -1
  std::vector<std::int16_t> doubted;   // one an edge: a boundary given up, which others may confirm, or -1
  std::vector<std::uint8_t> still;  // one an edge: in the last frame under the same slide it was where it is
  std::vector<float> seen_px;  // [line][boundary]: where its line has it, NaN: nowhere. For the next frame
  SequenceCounts counts;
  double score = 0;  // sum over the lines: the greater, the better the slides' order explains the frame
};

/// The frames before, as far as there are any.
struct SequenceContext {
  SlideOrder order{};
  const DifferenceImage* other = nullptr;  // the last frame under the other slide
  const DifferenceImage* same = nullptr;  // the last frame before that under the slide that the edges are of;
                                          // of one slide, the last frame
  const std::vector<ColumnRange>* expected = nullptr;  // of each boundary, from the depths before
  float other_share = 0.5F;  // where `other` lies in time on the way back to `same`: 0 now, 1 there
  const FieldMotion* motion = nullptr;  // between the fields that the edges are of
  float other_fields = 2;               // how many times as long ago `other` was as the fields lie apart
  const std::vector<float>* before_px = nullptr;  // SequenceResult::seen_px of the frame decoded before
  const FieldMotion* before_motion = nullptr;     // between that frame's fields
  float before_fields = 2;                        // how many times as long ago that was
  const Backdrop* backdrop = nullptr;             // where boundaries stand still when nothing hides them
};

/// A slide's boundaries by their colours.
struct SlideColours {
  std::vector<std::array<Primary, 2>> colours;  // on both sides of each
  BoundaryColours table;                        // the same, with those under the other slide
  // Of each code, ((left * 8 + right) * 8 + other_left) * 8 + other_right: its boundary, -1 where it has none
  // or several.
  std::vector<std::int16_t> by_code;
};

/// As the newer frame shows them where that is of the pattern's first slide, and of its second.
std::array<SlideColours, 2> slide_colours(const Pattern& pattern);

/// Constant after construction but for scratch memory. One thread.
class SequenceDecoder {
 public:
  explicit SequenceDecoder(const Pattern& pattern);

  /// `out` is overwritten; its memory is reused.
  void decode(const EdgeImage& edges, const SequenceContext& context, WorkerPool& pool, SequenceResult& out);

  /// How well the side of `edge` that does so less agrees, -1..1, with what `boundary` shows in the last
  /// frame under the other slide, were the scene still. 0 where there is no such frame.
  float other_agreement(const Edge& edge, int line, int boundary, const SequenceContext& context) const;

  /// Colours to the left and right of each boundary, under the slide that the newer frame shows.
  const std::vector<std::array<Primary, 2>>& shown_colours(SlideOrder order) const {
    return slides_[order == SlideOrder::kNewerIsFirst ? 0 : 1].colours;
  }

 private:
  /// An edge whose boundary is not settled.
  struct Open {
    int line;
    std::uint32_t edge;
    bool left, right;  // its neighbour on that side is the boundary's own
  };
  struct Scratch {
    EdgeSides sides;            // of one line
    std::vector<float> off_px;  // of its edges: how far off the other slide's frame showed them
    PathCandidates candidates;
    std::vector<std::int32_t> near_boundary;  // of an edge, those of its colours,
    std::vector<float> near_gain;             // and their gains
    std::vector<std::uint8_t> clear;          // one an edge of it
    double score = 0;
    std::size_t in_order = 0;
    std::vector<Open> open;  // of the worker's lines
    std::size_t unsupported = 0;
  };
  /// What the other slide's frame shows on an edge's sides.
  struct Beside {
    SideEvidence left, right;
    bool tracked;  // the edge was found two frames ago, so this belongs to it
  };

  /// What an edge shows where nothing of it is in doubt.
  struct Clear {
    int boundary;     // -1: something is, or no boundary of the pattern shows so
    float own, gain;  // of its own frame, and with the other slide's
  };

  void look_beside(const EdgeImage& edges, int line, const SequenceContext& context, Scratch& scratch,
                   SequenceResult& out);
  static EdgeAgreement agreement_of(const Edge& edge, const Beside& beside);
  static void clear_boundary(const Edge& edge, const Beside& beside, const SlideColours& shown, Clear& out);
  void decode_line(const EdgeImage& edges, int line, const SequenceContext& context, Scratch& scratch,
                   SequenceResult& out);
  void check_motion(const EdgeImage& edges, int line, const SequenceContext& context, Scratch& scratch,
                    SequenceResult& out);
  bool unconfirmed(const EdgeImage& edges, int line, std::uint32_t e, const SequenceContext& context,
                   int boundary) const;
  bool moved_as_measured(const EdgeImage& edges, int line, std::uint32_t e, const SequenceContext& context,
                         int boundary) const;
  template <class AsAsked>
  bool was_seen(int line, const SequenceContext& context, int boundary, AsAsked as_asked) const;
  bool as_deep(const EdgeImage& edges, int line, std::uint32_t first, std::uint32_t end,
               const SequenceResult& out) const;
  static float moved_px(int line, float column_px, const SequenceContext& context);
  int choose_moving(const EdgeImage& edges, int line, std::uint32_t e, const SequenceContext& context,
                    Scratch& scratch, std::int32_t* boundary, float* gains) const;
  float expected_gain(int line, float column_px, float was_px, const SequenceContext& context,
                      int boundary) const;
  std::int32_t& cell(int line, int boundary);
  bool is_meeting(const SequenceContext& context, int left, int own, int right) const;
  bool would_meet(const EdgeImage& edges, int line, std::uint32_t e, const SequenceContext& context,
                  int boundary, const SequenceResult& result) const;
  void give_up_meetings(const EdgeImage& edges, int line, const SequenceContext& context,
                        SequenceResult& out) const;
  void place_on_grid(const EdgeImage& edges, int line, const SequenceContext& context, SequenceResult& out);
  bool goes_on(const EdgeImage& edges, int line, std::uint32_t e, int boundary, int direction, bool left);
  void check(const EdgeImage& edges, const SequenceContext& context, WorkerPool& pool, SequenceResult& out);
  void complete(const EdgeImage& edges, const SequenceContext& context, SequenceResult& out);
  bool convincing(const Edge& edge, const Beside& beside, const SequenceContext& context, int boundary) const;
  float gain(const Edge& edge, const Beside& beside, const SequenceContext& context, int boundary) const;

  const SlideColours& shown_slide(const SequenceContext& c) const {
    return slides_[c.order == SlideOrder::kNewerIsFirst ? 0 : 1];
  }
  const SlideColours& other_slide(const SequenceContext& c) const {
    return slides_[c.order == SlideOrder::kNewerIsFirst ? 1 : 0];
  }

  std::array<SlideColours, 2> slides_;
  int boundaries_;
  SeenDepths depths_;  // by the frame before
  std::vector<Scratch> scratch_;
  std::vector<Beside> beside_;            // one an edge
  std::vector<std::uint8_t> convincing_;  // one an edge: what it was decoded as by its line is
  std::vector<std::int32_t> grid_;        // [line][boundary]: edge or -1
  std::vector<std::uint8_t> verdict_;     // one an edge
  std::vector<Open> without_;             // edges without a boundary, in order
};

/// True where both pictures were taken under the same slide (5.2.3): the signs of what stands out agree.
bool same_slide(const DifferenceImage& a, const DifferenceImage& b);

}  // namespace relievo
