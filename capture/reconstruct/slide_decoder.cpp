// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/slide_decoder.h"

#include <atomic>
#include <optional>
#include <utility>

#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/continuity.h"
#include "capture/reconstruct/detect.h"
#include "capture/reconstruct/doubtful.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/field_place.h"
#include "capture/reconstruct/front_edge.h"
#include "capture/reconstruct/grow.h"
#include "capture/reconstruct/instant.h"
#include "capture/reconstruct/leaning.h"
#include "capture/reconstruct/match.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/persistence.h"
#include "capture/reconstruct/place_grid.h"
#include "capture/reconstruct/quick_difference.h"
#include "capture/reconstruct/quick_place.h"
#include "capture/reconstruct/quick_sequence.h"
#include "capture/reconstruct/readmit.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/refine.h"
#include "capture/reconstruct/render_place.h"
#include "capture/reconstruct/rim_codes.h"
#include "capture/reconstruct/second_places.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/sharp_luma.h"
#include "capture/reconstruct/smooth_across.h"
#include "capture/reconstruct/trace.h"
#include "capture/reconstruct/weak_signal.h"
#include "capture/reconstruct/weigh.h"

namespace relievo {
namespace {

SlideOrder other(SlideOrder order) {
  return order == SlideOrder::kNewerIsFirst ? SlideOrder::kNewerIsSecond : SlideOrder::kNewerIsFirst;
}

/// What is kept of one frame, for the decoder in use.
struct Observation {
  std::int64_t time_ns = 0;
  Detection detection;         // the paper's
  DifferenceImage difference;  // the ordered one's
  QuickImage quick;            // the quick one's
};

}  // namespace

struct SlideDecoder::State {
  State(const Rig& rig, const Pattern& p, const ReconstructOptions& options)
      : pattern(p),
        line_stride(options.line_stride),
        field_ns(0.5e9 / rig.frame_rate),
        paper(options.decoder == Decoder::kPaper),
        quick(options.decoder == Decoder::kQuick),
        detector(rig.colour_matrix, DetectOptions{}),
        table(p),
        differencer(rig.colour_matrix),
        quick_differencer(rig.colour_matrix),
        sequence(p),
        quick_sequence(p),
        front_edges(rig),
        refiner(rig.colour_matrix),
        quick_placer(rig.colour_matrix),
        continuity(p.boundaries(), line_count(rig, options.line_stride)),
        readmission(p.boundaries(), line_count(rig, options.line_stride)),
        instant(p.boundaries(), line_count(rig, options.line_stride), 1e9 / rig.frame_rate),
        field_placer(rig.colour_matrix, p.boundaries()),
        growth(rig.colour_matrix, p.boundaries(), line_count(rig, options.line_stride)),
        render_placer(rig.colour_matrix) {}

  Pattern pattern;
  int line_stride;
  double field_ns;  // between a slide's exposure and its complement's
  bool paper, quick;
  Detector detector;
  TransitionTable table;
  Differencer differencer;
  QuickDifferencer quick_differencer;
  EdgeFinder edge_finder;
  SequenceDecoder sequence;
  QuickSequence quick_sequence;
  WeakSignal weak_signal;
  Tracer tracer;
  FrontEdges front_edges;
  Refiner refiner;
  LeanCorrection leaning;
  QuickPlacer quick_placer;
  ConsistencyCheck consistency;
  Recovery recovery;
  Continuity continuity;
  Readmission readmission;
  InstantFilter instant;
  MovingPlaces moving;
  FieldPlacer field_placer;
  Growth growth;
  PlaceGrid places;
  SequenceCounts quick_counts;
  Persistence persistence;
  RenderPlacer render_placer;
  SecondPlaces second_places;

  Observation newer;
  Observation previous;  // the frame before
  Observation older;     // the last frame under the slide that `newer` does not show
  Observation same;      // the last one before `older` under the slide that `newer` shows; of one slide, that
                         // before `newer`
  bool have_previous = false;
  bool have_same = false;
  bool have_older = false;
  SlideOrder order =
      SlideOrder::kNewerIsSecond;  // of the last pair; until it is decoded, if slides alternate
  bool order_known = false;

  std::vector<float> before_px;                        // SequenceResult::seen_px of the frame decoded last,
  FieldMotion before_motion;                           // the motion in it,
  std::optional<std::int64_t> before_ns;               // and its time
  const std::vector<ColumnRange>* expected = nullptr;  // of the frame being decoded
  Match match, other_match;
  EdgeImage edges;
  SequenceResult result, other_result;
  std::vector<RecoveredBoundary> recovered;

  /// That `newer` shows, as it was matched last.
  int slide() const { return pattern.slides == 1 || order == SlideOrder::kNewerIsFirst ? 0 : 1; }
  bool shows_same_slide() const;
  bool match_paper(SlideOrder tried, Match& out);
  SequenceContext context(SlideOrder tried) const;
  bool match_ordered(SlideOrder tried, WorkerPool& pool, SequenceResult& out);
  void match_quickly(SlideOrder predicted, WorkerPool& pool);
  QuickContext quick_context(SlideOrder tried) const;
  void decode_quickly(const CapturedFrame& pair, WorkerPool& pool, ReconstructReport& report,
                      DecodedGrid& out);
  void match_in_order(SlideOrder predicted, WorkerPool& pool);
  void look_again(const DetectionLines& rows, WorkerPool& pool, ReconstructReport& report);
  std::size_t fill(WorkerPool& pool, DecodedGrid& out) const;
};

bool SlideDecoder::State::shows_same_slide() const {
  if (quick) return same_slide(newer.quick, previous.quick);
  return paper ? same_slide(newer.detection, previous.detection)
               : same_slide(newer.difference, previous.difference);
}

/// True where the order explains most of what was seen.
bool SlideDecoder::State::match_paper(SlideOrder tried, Match& out) {
  if (pattern.slides == 1) {
    decode_single_slide(newer.detection, table, out);
  } else {
    match_boundaries(newer.detection, older.detection, tried, table, out);
  }
  return out.valid * 2 > newer.detection.boundaries.size();
}

SequenceContext SlideDecoder::State::context(SlideOrder tried) const {
  SequenceContext out{.order = tried};
  out.expected = expected;
  out.backdrop = &growth.backdrop();
  out.motion = &newer.difference.motion;
  if (before_ns) {
    out.before_px = &before_px;
    out.before_motion = &before_motion;
    out.before_fields = static_cast<float>(static_cast<double>(newer.time_ns - *before_ns) / field_ns);
  }
  if (have_older) {
    out.other = &older.difference;
    out.other_fields = static_cast<float>(static_cast<double>(newer.time_ns - older.time_ns) / field_ns);
  }
  if (have_same) {
    out.same = &same.difference;
    const auto back = static_cast<float>(newer.time_ns - same.time_ns);
    if (back > 0) out.other_share = static_cast<float>(newer.time_ns - older.time_ns) / back;
  }
  return out;
}

QuickContext SlideDecoder::State::quick_context(SlideOrder tried) const {
  QuickContext out{.order = tried, .expected = expected};
  if (have_older) out.other = &older.quick;
  if (have_same) out.same = &same.quick;
  const auto back = static_cast<float>(newer.time_ns - same.time_ns);
  if (have_older && have_same && back > 0)
    out.other_share = static_cast<float>(newer.time_ns - older.time_ns) / back;
  return out;
}

bool SlideDecoder::State::match_ordered(SlideOrder tried, WorkerPool& pool, SequenceResult& out) {
  sequence.decode(edges, context(tried), pool, out);
  return out.counts.in_order * 2 > edges.edges.size();
}

/// `predicted` is the order if slides alternate. Where it explains little, both are tried: "each frame is
/// decoded using the tuple which gives more valid stripe positions" (5.3).
void SlideDecoder::State::match_in_order(SlideOrder predicted, WorkerPool& pool) {
  order = predicted;
  const bool good = paper ? match_paper(order, match) : match_ordered(order, pool, result);
  if (pattern.slides == 1 || (good && order_known)) return;
  const bool other_good =
      paper ? match_paper(other(order), other_match) : match_ordered(other(order), pool, other_result);
  order_known = good || other_good;
  if (paper ? other_match.valid > match.valid : other_result.score > result.score) {
    std::swap(match, other_match);
    std::swap(result, other_result);
    order = other(order);
  }
}

/// As match_in_order().
void SlideDecoder::State::match_quickly(SlideOrder predicted, WorkerPool& pool) {
  const auto try_order = [&](SlideOrder tried) {
    order = tried;
    quick_counts = quick_sequence.decode(newer.quick, quick_context(tried), pool);
    return quick_counts.in_order;
  };
  const std::size_t most = quick_sequence.line_start().back();
  const std::size_t found = try_order(predicted);
  if (pattern.slides == 1 || (found * 2 > most && order_known)) return;
  const std::size_t other_found = try_order(other(predicted));
  order_known = std::max(found, other_found) * 2 > most;
  if (other_found <= found) try_order(predicted);
}

void SlideDecoder::State::decode_quickly(const CapturedFrame& pair, WorkerPool& pool,
                                         ReconstructReport& report, DecodedGrid& out) {
  const DetectionLines rows(pair, line_stride);
  report.filters.duplicate = quick_placer.place({newer.quick, rows.own, quick_sequence.shown_colours(order)},
                                                quick_sequence, pool, consistency);
  const ConsistencyCounts checked = consistency.settle(pool);
  const ContinuityCounts by_before = continuity.check(quick_sequence, consistency, pool);
  if (pattern.scheme == Scheme::kWhiteField) {
    places.fill(pattern.boundaries(), pool, consistency);
  } else {
    instant.adjust(pair.time_ns, consistency, pool, places);
  }
  moving.find(newer.quick.width, consistency, places);
  recovered.clear();
  const std::size_t carried = persistence.carry(moving, pool, places, recovered);
  const std::size_t weighed = weigh(places, pool, out);
  const std::size_t doubtful = give_up_doubtful(moving, newer.quick.width, pool, out);
  smooth_across(pool, out);
  report.filters.unsupported = quick_counts.unsupported;
  report.filters.completed = quick_counts.completed;
  report.filters.rejected = checked.rejected + by_before.rejected + doubtful;
  report.filters.moved = checked.moved + weighed;
  report.filters.recovered = by_before.carried + carried;
  report.matched =
      quick_counts.in_order - quick_counts.unsupported + quick_counts.completed + report.filters.recovered;
}

/// What is still unsure after all, against the picture itself, and rims that look like boundaries.
void SlideDecoder::State::look_again(const DetectionLines& rows, WorkerPool& pool,
                                     ReconstructReport& report) {
  const auto& shown = sequence.shown_colours(order);
  const RenderCounts rendered = render_placer.place({.rows = rows,
                                                     .colours = shown,
                                                     .places = places,
                                                     .moving = moving,
                                                     .blur_px = refiner.blur_px(),
                                                     .ambient = refiner.ambient()},
                                                    pool, result, edges, recovered);
  const std::size_t rims = drop_rims(rows, newer.difference, shown, sequence.shown_colours(other(order)),
                                     front_edges.front(), pool, places, result, edges, recovered);
  // Weighed anew among places that are better now.
  const std::size_t weighed = weigh(places, pool, result, edges, recovered);
  report.filters.rejected += rendered.rejected + rims;
  report.filters.moved += rendered.moved + weighed;
  report.filters.recovered += rendered.restored;
  report.matched += rendered.restored;
}

/// Puts each boundary in its place. Returns how many were in one that another one has.
std::size_t SlideDecoder::State::fill(WorkerPool& pool, DecodedGrid& out) const {
  const auto& starts = paper ? newer.detection.line_start : edges.line_start;
  const std::vector<std::int16_t>& found = paper ? match.boundary : result.boundary;
  std::atomic<std::size_t> duplicates{0};
  pool.for_shares(starts, [&](int begin, int end, int) {
    std::size_t own_duplicates = 0;
    for (int line = begin; line < end; ++line) {
      out.start_line(line);
      for (std::uint32_t i = starts[static_cast<std::size_t>(line)];
           i < starts[static_cast<std::size_t>(line) + 1]; ++i) {
        if (found[i] < 0) continue;
        if (paper) {
          const Boundary& b = newer.detection.boundaries[i];
          own_duplicates += !out.put(line, found[i], b.column_px, 0, b.slope);
        } else {
          const Edge& e = edges.edges[i];
          own_duplicates += !out.put(line, found[i], e.column_px, e.sigma_px, e.slope);
        }
      }
    }
    duplicates += own_duplicates;
  });
  std::size_t twice = duplicates;
  if (paper) return twice;
  for (const RecoveredBoundary& r : recovered)
    twice += !out.put(r.line, r.boundary, r.column_px, r.sigma_px, r.slope);
  return twice;
}

SlideDecoder::SlideDecoder(const Rig& rig, const Pattern& pattern, const ReconstructOptions& options)
    : state_(std::make_unique<State>(rig, pattern, options)) {}
SlideDecoder::SlideDecoder(SlideDecoder&&) noexcept = default;
SlideDecoder& SlideDecoder::operator=(SlideDecoder&&) noexcept = default;
SlideDecoder::~SlideDecoder() = default;

void SlideDecoder::observe(const CapturedFrame& pair, WorkerPool& pool, ReconstructReport& report) {
  State& s = *state_;
  std::swap(s.newer, s.previous);
  s.newer.time_ns = pair.time_ns;
  const DetectionLines rows(pair, s.line_stride);
  if (s.paper) {
    s.detector.detect(rows, pool, s.newer.detection);
    report.boundaries = s.newer.detection.boundaries.size();
  } else if (s.quick) {
    report.boundaries = s.quick_sequence.find_edges(rows, s.quick_differencer, pool, s.newer.quick);
  } else {
    s.differencer.aligned_difference(rows, pool, s.newer.difference);
    s.weak_signal.average(pool, s.newer.difference);
    s.edge_finder.find(s.newer.difference, pool, s.edges);
    report.boundaries = s.edges.edges.size();
  }
  // Two frames in a row under one slide: one between them was dropped (5.2.3). The newer takes the place of
  // the one before, as in the paper, and is decoded all the same, with the last frame under the other slide.
  const bool have_previous = std::exchange(s.have_previous, true);
  report.same_slide = s.pattern.slides == 2 && have_previous && s.shows_same_slide();
  if (!report.same_slide) s.order = other(s.order);
  if (s.pattern.slides == 1 && have_previous) {
    std::swap(s.same, s.previous);
    s.have_same = true;
  }
  if (s.pattern.slides == 2 && have_previous && !report.same_slide) {
    // previous becomes other, other becomes same; the memory of the oldest serves the next frame.
    std::swap(s.same, s.previous);
    std::swap(s.same, s.older);
    s.have_same = std::exchange(s.have_older, true);
  }
}

bool SlideDecoder::decode(const SlideView& view, WorkerPool& pool, ReconstructReport& report,
                          DecodedGrid& out) {
  State& s = *state_;
  s.second_places.clear();
  if (!s.have_older && s.pattern.slides == 2) return false;
  const CapturedFrame& pair = view.pair;
  s.expected = view.expected;
  if (s.quick) {
    s.match_quickly(s.order, pool);
    report.slide = s.slide();
    s.decode_quickly(pair, pool, report, out);
    return true;
  }
  s.match_in_order(s.order, pool);
  report.slide = s.slide();
  if (s.paper) {
    report.matched = s.match.valid;
    report.filters.duplicate = s.fill(pool, out);
    return true;
  }
  const DetectionLines rows(pair, s.line_stride);
  const std::size_t traced =
      s.tracer.trace(s.newer.difference, s.sequence, s.context(s.order), pool, s.result, s.edges);
  report.filters.traced = traced;
  report.filters.fronts = s.front_edges.correct(s.edges, s.sequence.shown_colours(s.order),
                                                s.sequence.shown_colours(other(s.order)), pool, s.result);
  std::swap(s.before_px, s.result.seen_px);
  s.before_motion = s.newer.difference.motion;
  s.before_ns = pair.time_ns;
  const SharpLuma sharp(rows);
  s.refiner.refine(s.newer.difference, rows.own, s.result, s.sequence.shown_colours(s.order), pool, s.edges,
                   &sharp);
  const std::size_t borrowed =
      s.leaning.correct(rows, s.newer.difference, s.pattern.boundaries(), pool, s.result, s.edges);
  const ConsistencyCounts checked = s.consistency.check(s.pattern.boundaries(), pool, s.result, s.edges);
  const SequenceCounts& counts = s.result.counts;
  report.filters.unsupported = counts.unsupported;
  report.filters.completed = counts.completed;
  report.filters.rejected = borrowed + checked.rejected;
  report.filters.moved = checked.moved;
  s.recovery.recover({.shown = s.newer.difference,
                      .slide = rows.own,
                      .shown_colours = s.sequence.shown_colours(s.order),
                      .other = s.have_older ? &s.older.difference : nullptr,
                      .other_colours = s.sequence.shown_colours(other(s.order))},
                     s.refiner, s.edges, s.result, pool, s.recovered);
  report.filters.recovered = s.recovered.size();
  const ContinuityCounts by_before = s.continuity.check(s.recovered, pool, s.result, s.edges);
  report.filters.rejected += by_before.rejected;
  report.filters.recovered += by_before.carried;
  report.filters.recovered += s.readmission.readmit(s.recovered, s.result, s.edges);
  report.matched =
      counts.in_order - counts.unsupported + counts.completed + traced + report.filters.recovered;
  // Under white-field the difference is of the slide's own instant already.
  if (s.pattern.scheme != Scheme::kWhiteField)
    s.instant.adjust({pair.time_ns, s.newer.difference.motion}, s.result, s.edges, s.recovered, pool);
  s.moving.find(s.newer.difference.width, s.result, s.edges);
  const SlideFieldView field{
      rows.slide(),       s.sequence.shown_colours(s.order), &s.newer.difference.motion,
      s.slide(),          s.newer.difference.noise,          &s.moving,
      s.refiner.ambient()};
  s.field_placer.place(field, s.result, pool, s.edges);
  const std::size_t grown = s.growth.grow(field, s.edges, pool, s.result, s.recovered);
  report.filters.recovered += grown;
  report.matched += grown;
  s.places.fill(s.pattern.boundaries(), pool, s.result, s.edges, s.recovered);
  const std::size_t carried = s.persistence.carry(s.moving, pool, s.places, s.recovered);
  report.filters.recovered += carried;
  report.matched += carried;
  report.filters.moved += weigh(s.places, pool, s.result, s.edges, s.recovered);
  // Of speckle no picture can be told.
  const bool clear = !s.moving.much() && !s.consistency.speckled();
  // Without an earlier frame under the slide nothing tells what moves.
  if (clear && s.have_same) s.look_again(rows, pool, report);
  report.filters.duplicate = s.fill(pool, out);
  report.filters.rejected += give_up_doubtful(s.moving, s.newer.difference.width, pool, out);
  smooth_across(pool, out);
  if (clear) {
    const std::size_t second =
        s.second_places.find({s.edges, s.result, s.sequence, s.context(s.order), s.moving, out}, pool);
    report.filters.recovered += second;
    report.matched += second;
  }
  return true;
}

const MovingPlaces& SlideDecoder::moving() const {
  return state_->moving;
}

const std::vector<std::array<Primary, 2>>& SlideDecoder::shown_colours() const {
  const State& s = *state_;
  return s.quick ? s.quick_sequence.shown_colours(s.order) : s.sequence.shown_colours(s.order);
}

const std::vector<SecondPlace>& SlideDecoder::second_places() const {
  return state_->second_places.found();
}

}  // namespace relievo
