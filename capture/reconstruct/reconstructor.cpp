// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/reconstructor.h"

#include <atomic>
#include <cmath>
#include <mutex>
#include <utility>

#include "base/parallel.h"
#include "base/time.h"
#include "capture/reconstruct/depth_range.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/exposure_doubt.h"
#include "capture/reconstruct/exposure_order.h"
#include "capture/reconstruct/field_balance.h"
#include "capture/reconstruct/field_pairs.h"
#include "capture/reconstruct/half_way.h"
#include "capture/reconstruct/moving_texture.h"
#include "capture/reconstruct/slide_decoder.h"
#include "capture/reconstruct/surface_builder.h"
#include "capture/reconstruct/texture.h"
#include "capture/reconstruct/triangulate.h"
#include "capture/reconstruct/white_texture.h"
#include "capture/upright.h"

namespace relievo {
namespace {

constexpr int kDepthLines = 8;           // one line in so many tells the range of depths
constexpr std::size_t kSpareFrames = 4;  // a stage's queue and what its neighbours hold

Status check_fits(const CapturedFrame& frame, const Rig& rig) {
  const std::string name = "frame " + std::to_string(frame.number) + " is ";
  const auto size = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  if (frame.scan == Scan::kInterlaced && frame.field_order != rig.field_order) {
    return Error{name + std::string(to_string(frame.field_order)) +
                 " field first but rig.yaml says field_order: " + std::string(to_string(rig.field_order))};
  }
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

Status check_lines(int stride) {
  if (stride != 1 && stride != 2 && stride != 4)
    return Error{"line_stride is 1, 2 or 4, not " + std::to_string(stride)};
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

std::string_view decoder_name(Decoder decoder) {
  switch (decoder) {
    case Decoder::kOrdered:
      return "ordered";
    case Decoder::kQuick:
      return "quick";
    case Decoder::kPaper:
      return "paper";
  }
  return "";
}

std::optional<Decoder> decoder_named(std::string_view name) {
  for (const Decoder d : {Decoder::kOrdered, Decoder::kQuick, Decoder::kPaper})
    if (name == decoder_name(d)) return d;
  return std::nullopt;
}

struct Reconstructor::State {
  State(const Rig& r, const Pattern& p, const ReconstructOptions& o)
      : rig(r),
        pattern(p),
        options(o),
        pool(o.threads),
        response(r.camera_gamma),
        steps(p, r),
        pairs(p.scheme, r),
        balance(r.colour_matrix),
        decoder(r, p, o),
        lines(line_count(r, o.line_stride)),
        triangulator(r, p, lines, line_step_px(r.scan, o.line_stride)),
        depths(p.boundaries(), r.camera.width, lines, kDepthLines),
        white_texture(r.colour_matrix, response, o.decoder == Decoder::kQuick, o.line_stride),
        moving_texture(r.colour_matrix, response, o.line_stride),
        half_way(p.boundaries(), lines, r.camera.width),
        surface_builder(r, line_step_px(r.scan, o.line_stride), o.surface,
                        o.decoder == Decoder::kPaper ? 0 : SurfaceOptions{}.least_component) {
    decoded.reset(p.boundaries(), lines);
    if (p.scheme == Scheme::kWhiteField) decoded_between.reset(p.boundaries(), lines);
    if (p.slides == 1) exposure_order.emplace(r, p, o.line_stride);
    // Under white-field the white one of two exposures tells.
    if (p.slides == 2 && p.scheme != Scheme::kWhiteField) exposure_doubt.emplace(r, p, o.line_stride);
    spare.reserve(kSpareFrames);
  }

  Rig rig;
  Pattern pattern;
  ReconstructOptions options;
  WorkerPool pool;
  CameraResponse response;
  StepKeeper steps;
  std::optional<ExposureOrder> exposure_order;  // of a single slide
  std::optional<ExposureDoubt> exposure_doubt;  // of two
  FieldPairs pairs;
  FieldBalance balance;
  SlideDecoder decoder;
  int lines;  // of a frame
  Triangulator triangulator;
  DepthRange depths;
  WhiteTexture white_texture;
  MovingTexture moving_texture;
  HalfWay half_way;  // white-field
  SurfaceBuilder surface_builder;

  DecodedGrid decoded;
  DecodedGrid decoded_between;                             // white-field
  std::vector<SecondPlace> second_before, second_between;  // the same
  std::optional<Frame3D> waiting;
  Image8 last_texture;  // white-field: of the frame before
  std::int64_t last_texture_time_ns = 0;
  ReconstructReport report;
  CapturedFrame straight;               // the last frame in light, of a camera with a curve
  const CapturedFrame* pair = nullptr;  // what the last frame's exposures show, in light; null: no slide

  std::mutex spare_mutex;
  std::vector<Frame3D> spare;  // handed back; guarded by spare_mutex

  void forget();
  Result<const CapturedFrame*> observe(const CapturedFrame& captured);
  Frame3D blank_frame();
  void make_surface(DecodedGrid& grid, const std::vector<SecondPlace>& second, Surface& out);
  SeenFrame seen(const CapturedFrame& frame) const;
  void make_texture(const CapturedFrame& frame, Image8& out);
  std::optional<Frame3D> surface_between(const CapturedFrame& frame);
};

/// What was seen before, but for the depths.
void Reconstructor::State::forget() {
  pairs.forget();
  decoder = SlideDecoder(rig, pattern, options);
  half_way = HalfWay(pattern.boundaries(), lines, rig.camera.width);
  second_before.clear();
}

/// The frame in step of which `pair` is made; null where there is none yet.
Result<const CapturedFrame*> Reconstructor::State::observe(const CapturedFrame& captured) {
  if (auto fits = check_fits(captured, rig); !fits) return fits.error();
  report = {};
  waiting.reset();
  pair = nullptr;
  StageClock clock;
  const CapturedFrame* frame = steps.read(captured);
  report.step = steps.report();
  if (report.step.restarted) forget();
  if (frame == nullptr) return frame;
  if (!response.is_straight()) response.straighten(*frame, pool, straight);
  pair = pairs.read(seen(*frame), pool);
  report.white = pair == nullptr;
  if (pair == nullptr) return frame;
  if (options.decoder != Decoder::kPaper) {
    pair = &balance.balance(*pair, pool);
    report.slide_excess = balance.excess();
  }
  decoder.observe(*pair, pool, report);
  report.detect_ms = clock.lap_ms();
  return frame;
}

/// Of the frame that was observed last.
SeenFrame Reconstructor::State::seen(const CapturedFrame& frame) const {
  return {frame, response.is_straight() ? frame : straight};
}

/// Whatever it holds is overwritten.
Frame3D Reconstructor::State::blank_frame() {
  std::lock_guard lock(spare_mutex);
  if (spare.empty()) return {};
  Frame3D out = std::move(spare.back());
  spare.pop_back();
  return out;
}

void Reconstructor::State::make_surface(DecodedGrid& grid, const std::vector<SecondPlace>& second,
                                        Surface& out) {
  StageClock clock;
  std::atomic<std::size_t> points{0};
  std::atomic<std::size_t> no_point{0};
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    PointCounts own;
    for (int line = begin; line < end; ++line) own += triangulator.place_line(line, grid);
    points += own.points;
    no_point += own.no_point;
  });
  report.filters.no_point += no_point;
  if (options.decoder != Decoder::kPaper) depths.update(grid, points, triangulator, pool);
  report.triangulate_ms += clock.lap_ms();
  surface_builder.build(grid, second, triangulator, pool, out, report.filters);
  report.surface_ms += clock.lap_ms();
}

/// After make_surface().
void Reconstructor::State::make_texture(const CapturedFrame& frame, Image8& out) {
  if (!options.texture) {
    out = {};  // of a frame that came back
  } else if (pairs.white(frame, out)) {
    return;
  } else if (options.decoder == Decoder::kPaper) {
    add_fields(frame, response, pool, out);
  } else {
    white_texture.make(seen(frame), decoded, pool, out);
    moving_texture.mend(seen(frame).light, {decoded, decoder.shown_colours(), decoder.moving()},
                        white_texture.gains(), pool, out);
  }
}

/// White-field: the surface of the white field before this frame, half way between this frame's and the last
/// one's. Nothing where a frame was lost between.
std::optional<Frame3D> Reconstructor::State::surface_between(const CapturedFrame& frame) {
  const std::int64_t frame_ns = std::llround(1e9 / rig.frame_rate);
  const std::optional<std::int64_t> before_ns = half_way.time_ns();
  if (!half_way.place(decoded, frame.time_ns, frame_ns * 3 / 2, decoded_between)) return std::nullopt;
  Frame3D out = blank_frame();
  out.number = frame.number;
  out.time_ns = *before_ns + (frame.time_ns - *before_ns) / 2;
  out.between = true;
  second_half_way(second_before, decoder.second_places(), second_between);
  make_surface(decoded_between, second_between, out.surface);
  if (options.texture) {
    copy_picture(last_texture, out.texture);
  } else {
    out.texture = {};  // of a frame that came back
  }
  out.texture_time_ns = last_texture_time_ns;
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
  if (pattern.stripes() > rig.projector.width) {
    return Error{"the pattern has " + std::to_string(pattern.stripes()) +
                 " stripes and the rig's projector " + std::to_string(rig.projector.width) +
                 " columns: are they of one rig?"};
  }
  if (auto status = check_lines(options.line_stride); !status) return status.error();
  if (pattern.scheme == Scheme::kOneSlide && options.decoder == Decoder::kPaper) {
    return Error{
        "the paper's decoder reads each code by itself, and those of scheme one-slide repeat: use the "
        "decoder ordered or quick"};
  }
  const auto seen = upright(rig, pattern);
  if (!seen) return seen.error();
  return Reconstructor(std::make_unique<State>(seen->rig, seen->pattern, options));
}

void Reconstructor::recycle(Frame3D&& used) {
  std::lock_guard lock(state_->spare_mutex);
  if (state_->spare.size() < kSpareFrames) state_->spare.push_back(std::move(used));
}

const Rig& Reconstructor::rig() const {
  return state_->rig;
}

const Pattern& Reconstructor::pattern() const {
  return state_->pattern;
}

const ReconstructReport& Reconstructor::report() const {
  return state_->report;
}

const CapturedFrame* Reconstructor::decoded() const {
  return state_->pair;
}

std::uint64_t Reconstructor::textures() const {
  return state_->pairs.textures();
}

std::optional<Frame3D> Reconstructor::next() {
  return std::exchange(state_->waiting, std::nullopt);
}

Status Reconstructor::observe(const CapturedFrame& captured) {
  const auto seen = state_->observe(captured);
  return seen ? Status() : Status(seen.error());
}

Result<std::optional<Frame3D>> Reconstructor::add(const CapturedFrame& captured) {
  State& s = *state_;
  const auto seen = s.observe(captured);
  if (!seen) return seen.error();
  if (s.pair == nullptr) return std::optional<Frame3D>();
  const CapturedFrame& frame = **seen;
  StageClock clock;
  const bool complete = s.decoder.decode({*s.pair, s.depths.columns()}, s.pool, s.report, s.decoded);
  s.report.match_ms = clock.lap_ms();
  if (!complete) return std::optional<Frame3D>();
  if (s.exposure_order && s.exposure_order->exchanged(*s.pair, s.report, s.pool)) {
    s.steps.exchange(captured);
    s.forget();
    s.report.step.restarted = true;
    return std::optional<Frame3D>();
  }
  if (s.exposure_doubt) s.report.exchanged = s.exposure_doubt->exchanged(*s.pair, s.report, s.pool);

  const bool white_field = s.pattern.scheme == Scheme::kWhiteField;
  std::optional<Frame3D> between;
  if (white_field) between = s.surface_between(frame);
  Frame3D out = s.blank_frame();
  out.number = frame.number;
  out.time_ns = frame.time_ns;
  out.between = false;
  s.make_surface(s.decoded, s.decoder.second_places(), out.surface);
  clock.lap_ms();
  out.texture_time_ns = s.pairs.texture_time_ns();
  s.make_texture(frame, out.texture);
  s.report.texture_ms = clock.lap_ms();
  if (white_field) {
    copy_picture(out.texture, s.last_texture);
    s.last_texture_time_ns = out.texture_time_ns;
    s.second_before = s.decoder.second_places();
  }
  if (!between) return std::optional<Frame3D>(std::move(out));
  s.waiting = std::move(out);
  return between;
}

}  // namespace relievo
