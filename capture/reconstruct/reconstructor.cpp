// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/reconstructor.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/parallel.h"
#include "base/time.h"
#include "capture/reconstruct/consistency.h"
#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/detect.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/field_difference.h"
#include "capture/reconstruct/instant.h"
#include "capture/reconstruct/match.h"
#include "capture/reconstruct/recover.h"
#include "capture/reconstruct/refine.h"
#include "capture/reconstruct/sequence.h"
#include "capture/reconstruct/surface_builder.h"
#include "capture/reconstruct/texture.h"
#include "capture/reconstruct/trace.h"
#include "capture/reconstruct/triangulate.h"
#include "capture/reconstruct/weak_signal.h"
#include "capture/reconstruct/white_texture.h"

namespace relievo {
namespace {

constexpr std::size_t kSpareFrames = 4;  // a stage's queue and what its neighbours hold

int line_step(const Rig& rig) {
  return rig.scan == Scan::kInterlaced ? 2 : 1;
}
int line_count(const Rig& rig) {
  return (rig.camera.height + line_step(rig) - 1) / line_step(rig);
}

SlideOrder other(SlideOrder order) {
  return order == SlideOrder::kNewerIsFirst ? SlideOrder::kNewerIsSecond : SlideOrder::kNewerIsFirst;
}

Status check_fits(const CapturedFrame& frame, const Rig& rig) {
  const std::string name = "frame " + std::to_string(frame.number) + " is ";
  const auto size = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  if (frame.scan != rig.scan) {
    return Error{name + std::string(to_string(frame.scan)) + " but rig.yaml says " +
                 std::string(to_string(rig.scan))};
  }
  for (const Image8* picture : {&frame.picture, &frame.complement}) {
    if (picture == &frame.complement && frame.scan == Scan::kInterlaced) continue;
    if (picture->width() != rig.camera.width || picture->height() != rig.camera.height) {
      return Error{name + size(picture->width(), picture->height()) + " but rig.yaml says " +
                   size(rig.camera.width, rig.camera.height)};
    }
    if (picture->channels() != 3) {
      return Error{name + "of " + std::to_string(picture->channels()) + " channels instead of three: RGB"};
    }
  }
  return {};
}

/// Milliseconds since the last call.
class StageClock {
 public:
  double lap_ms() {
    const std::int64_t now = steady_now_ns();
    return milliseconds(now - std::exchange(last_, now));
  }

 private:
  std::int64_t last_ = steady_now_ns();
};

}  // namespace

/// What is kept of one frame, for the decoder in use.
struct Observation {
  Detection detection;         // the paper's
  DifferenceImage difference;  // the ordered one's
};

struct Reconstructor::State {
  State(const Rig& r, const Pattern& p, const ReconstructOptions& o)
      : rig(r),
        pattern(p),
        options(o),
        pool(o.threads),
        detector(r.colour_matrix, DetectOptions{}),
        table(p),
        differencer(r.colour_matrix),
        sequence(p),
        refiner(r.colour_matrix),
        triangulator(r, p, line_count(r), line_step(r)),
        depths(p.boundaries(), r.camera.width, line_count(r)),
        instant(p.boundaries(), line_count(r), 1e9 / r.frame_rate),
        white_texture(r.colour_matrix),
        surface_builder(r, p.boundaries(), line_count(r), line_step(r), o.surface) {
    spare.reserve(kSpareFrames);
    worker_vertices.resize(static_cast<std::size_t>(pool.threads()));
  }

  Rig rig;
  Pattern pattern;
  ReconstructOptions options;
  WorkerPool pool;
  Detector detector;
  TransitionTable table;
  Differencer differencer;
  EdgeFinder edge_finder;
  SequenceDecoder sequence;
  WeakSignal weak_signal;
  Tracer tracer;
  Refiner refiner;
  ConsistencyCheck consistency;
  Recovery recovery;
  Triangulator triangulator;
  DepthRange depths;
  InstantFilter instant;
  WhiteTexture white_texture;
  SurfaceBuilder surface_builder;

  Observation newer;
  Observation previous;  // the frame before
  Observation older;     // the last frame under the slide that `newer` does not show
  Observation same;      // the last one before `older` under the slide that `newer` shows
  bool have_previous = false;
  bool have_same = false;
  bool have_older = false;
  SlideOrder order = SlideOrder::kNewerIsSecond;  // of the last decoded pair
  bool order_known = false;

  Match match, other_match;
  EdgeImage edges;
  SequenceResult result, other_result;
  std::vector<RecoveredBoundary> recovered;
  struct EdgePlace {
    float column_px, sigma_px, slope;
  };
  struct Vertices {
    std::vector<GridVertex> list;
    std::size_t no_point = 0;
  };
  std::vector<Vertices> worker_vertices;
  std::vector<GridVertex> vertices;
  ReconstructReport report;

  std::mutex spare_mutex;
  std::vector<Frame3D> spare;  // handed back; guarded by spare_mutex

  bool paper() const { return options.decoder == Decoder::kPaper; }
  void observe(const CapturedFrame& frame);
  bool shows_same_slide() const;
  bool match_paper(SlideOrder tried, Match& out);
  SequenceContext context(SlideOrder tried) const;
  bool match_ordered(SlideOrder tried, SequenceResult& out);
  void match_in_order(SlideOrder predicted, View8 slide);
  void add_vertex(int boundary, int line, const EdgePlace& place, Vertices& out) const;
  void triangulate();
  Frame3D blank_frame();
};

void Reconstructor::State::observe(const CapturedFrame& frame) {
  if (paper()) {
    detector.detect(frame, pool, newer.detection);
    report.boundaries = newer.detection.boundaries.size();
  } else {
    differencer.difference(frame, pool, newer.difference);
    weak_signal.average(pool, newer.difference);
    edge_finder.find(newer.difference, pool, edges);
    report.boundaries = edges.edges.size();
  }
}

bool Reconstructor::State::shows_same_slide() const {
  return paper() ? same_slide(newer.detection, previous.detection)
                 : same_slide(newer.difference, previous.difference);
}

/// True where the order explains most of what was seen.
bool Reconstructor::State::match_paper(SlideOrder tried, Match& out) {
  if (pattern.slides == 1) {
    decode_single_slide(newer.detection, table, out);
  } else {
    match_boundaries(newer.detection, older.detection, tried, table, out);
  }
  return out.valid * 2 > newer.detection.boundaries.size();
}

SequenceContext Reconstructor::State::context(SlideOrder tried) const {
  return {.order = tried,
          .other = have_older ? &older.difference : nullptr,
          .same = have_same ? &same.difference : nullptr,
          .expected = depths.columns()};
}

bool Reconstructor::State::match_ordered(SlideOrder tried, SequenceResult& out) {
  sequence.decode(edges, context(tried), pool, out);
  return out.counts.in_order * 2 > edges.edges.size();
}

/// `predicted` is the order if slides alternate. Where it explains little, both are tried: "each frame is
/// decoded using the tuple which gives more valid stripe positions" (5.3).
void Reconstructor::State::match_in_order(SlideOrder predicted, View8 slide) {
  order = predicted;
  const bool good = paper() ? match_paper(order, match) : match_ordered(order, result);
  if (pattern.slides == 2 && !(good && order_known)) {
    const bool other_good =
        paper() ? match_paper(other(order), other_match) : match_ordered(other(order), other_result);
    order_known = good || other_good;
    if (paper() ? other_match.valid > match.valid : other_result.score > result.score) {
      std::swap(match, other_match);
      std::swap(result, other_result);
      order = other(order);
    }
  }
  if (paper()) {
    report.matched = match.valid;
  } else {
    const TraceCounts traced = tracer.trace(newer.difference, sequence, context(order), pool, result, edges);
    refiner.refine(newer.difference, slide, result, sequence.shown_colours(order), pool, edges);
    const ConsistencyCounts checked = consistency.check(pattern.boundaries(), pool, result, edges);
    report.filters.traced = traced.added;
    report.filters.retraced = traced.moved;
    report.filters.unsupported = result.counts.unsupported;
    report.filters.completed = result.counts.completed;
    report.filters.rejected = checked.rejected;
    report.filters.moved = checked.moved;
    recovery.recover({.shown = newer.difference,
                      .slide = slide,
                      .shown_colours = sequence.shown_colours(order),
                      .other = have_older ? &older.difference : nullptr,
                      .other_colours = sequence.shown_colours(other(order))},
                     refiner, edges, result, pool, recovered);
    report.filters.recovered = recovered.size();
    report.matched = result.counts.in_order - result.counts.unsupported + result.counts.completed +
                     traced.added + recovered.size();
  }
}

void Reconstructor::State::add_vertex(int boundary, int line, const EdgePlace& place, Vertices& out) const {
  if (boundary < 0) return;
  const auto position = triangulator.point(boundary, line, place.column_px);
  if (!position) {
    ++out.no_point;
    return;
  }
  out.list.push_back({{.boundary = static_cast<std::uint16_t>(boundary),
                       .line = static_cast<std::uint16_t>(line),
                       .column_px = place.column_px,
                       .sigma_px = place.sigma_px},
                      *position,
                      place.slope});
}

void Reconstructor::State::triangulate() {
  for (Vertices& part : worker_vertices) {
    part.list.clear();
    part.no_point = 0;
  }
  pool.for_ranges(line_count(rig), [&](int begin, int end, int worker) {
    Vertices& out = worker_vertices[static_cast<std::size_t>(worker)];
    const auto& starts = paper() ? newer.detection.line_start : edges.line_start;
    for (int line = begin; line < end; ++line) {
      const auto l = static_cast<std::size_t>(line);
      for (std::uint32_t i = starts[l]; i < starts[l + 1]; ++i) {
        if (paper()) {
          const Boundary& b = newer.detection.boundaries[i];
          add_vertex(match.boundary[i], line, {b.column_px, 0, b.slope}, out);
        } else {
          const Edge& e = edges.edges[i];
          add_vertex(result.boundary[i], line, {e.column_px, e.sigma_px, e.slope}, out);
        }
      }
    }
  });
  if (!paper()) {
    for (const RecoveredBoundary& r : recovered)
      add_vertex(r.boundary, r.line, {r.column_px, r.sigma_px, r.slope}, worker_vertices.back());
  }
  vertices.clear();
  for (const Vertices& part : worker_vertices) {
    vertices.insert(vertices.end(), part.list.begin(), part.list.end());
    report.filters.no_point += part.no_point;
  }
  if (!paper()) depths.update(vertices, triangulator);
}

/// Whatever it holds is overwritten.
Frame3D Reconstructor::State::blank_frame() {
  std::lock_guard lock(spare_mutex);
  if (spare.empty()) return {};
  Frame3D out = std::move(spare.back());
  spare.pop_back();
  return out;
}

Reconstructor::Reconstructor(std::unique_ptr<State> state) : state_(std::move(state)) {}
Reconstructor::Reconstructor(Reconstructor&&) noexcept = default;
Reconstructor& Reconstructor::operator=(Reconstructor&&) noexcept = default;
Reconstructor::~Reconstructor() = default;

Result<Reconstructor> Reconstructor::create(const Rig& rig, const Pattern& pattern,
                                            const ReconstructOptions& options) {
  if (pattern.slides > 2) {
    return Error{"the pattern has " + std::to_string(pattern.slides) +
                 " slides; two frames in a row decode one or two: use a pattern with slides: 2"};
  }
  if (pattern.stripes() < 2) return Error{"the pattern has no boundary: it needs two stripes or more"};
  return Reconstructor(std::make_unique<State>(rig, pattern, options));
}

void Reconstructor::recycle(Frame3D&& used) {
  std::lock_guard lock(state_->spare_mutex);
  if (state_->spare.size() < kSpareFrames) state_->spare.push_back(std::move(used));
}

const ReconstructReport& Reconstructor::report() const {
  return state_->report;
}

Result<std::optional<Frame3D>> Reconstructor::add(const CapturedFrame& frame) {
  State& s = *state_;
  if (auto fits = check_fits(frame, s.rig); !fits) return fits.error();
  s.report = {};
  StageClock clock;
  std::swap(s.newer, s.previous);
  s.observe(frame);
  s.report.detect_ms = clock.lap_ms();

  // Two frames in a row under one slide: one between them was dropped (5.2.3). The newer takes the place of
  // the one before, as in the paper, and is decoded all the same, with the last frame under the other slide.
  const bool have_previous = std::exchange(s.have_previous, true);
  s.report.same_slide = s.pattern.slides == 2 && have_previous && s.shows_same_slide();
  if (s.pattern.slides == 2 && have_previous && !s.report.same_slide) {
    // previous becomes other, other becomes same; the memory of the oldest serves the next frame.
    std::swap(s.same, s.previous);
    std::swap(s.same, s.older);
    s.have_same = std::exchange(s.have_older, true);
  }
  if (!s.have_older && s.pattern.slides == 2) return std::optional<Frame3D>();
  s.match_in_order(s.report.same_slide ? s.order : other(s.order), frame.slide_field());
  s.report.match_ms = clock.lap_ms();

  Frame3D out = s.blank_frame();
  out.number = frame.number;
  out.time_ns = frame.time_ns;
  if (!s.paper()) s.instant.adjust(frame.time_ns, s.result, s.edges, s.recovered);
  s.triangulate();
  s.report.triangulate_ms = clock.lap_ms();

  s.surface_builder.build(s.vertices, s.triangulator, s.pool, out.surface, s.report.filters);
  s.report.surface_ms = clock.lap_ms();
  if (s.options.texture) {
    if (s.paper()) {
      add_fields(frame, s.pool, out.texture);
    } else {
      s.white_texture.make(frame, s.vertices, s.pool, out.texture);
    }
  } else {
    out.texture = {};  // of a frame that came back
  }
  s.report.texture_ms = clock.lap_ms();
  return std::optional<Frame3D>(std::move(out));
}

}  // namespace relievo
