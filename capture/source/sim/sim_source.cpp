// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/sim_source.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <utility>

#include "capture/pattern/bcsl.h"
#include "capture/pattern/repeating.h"
#include "capture/source/sim/render_ahead.h"
#include "capture/source/sim/renderer.h"
#include "capture/source/sim/scene.h"
#include "capture/source/sim/sim_options.h"

namespace relievo {
namespace {

constexpr std::uint64_t kLoopBytes = std::uint64_t{1} << 30;

class Simulator final : public SimSource {
 public:
  Simulator(SourceInfo info, const sim::SimOptions& options, const SimRun& run,
            std::shared_ptr<const sim::Renderer> renderer)
      : info_(std::move(info)), drop_(static_cast<std::uint64_t>(options.drop)), loop_(run.loop) {
    period_ = static_cast<std::uint64_t>(options.period);
    sim::RenderAhead::Options ahead;
    const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    ahead.threads = run.threads > 0 ? run.threads : std::min(cores, 8);
    ahead.ahead = static_cast<std::uint64_t>(2 * ahead.threads);
    ahead.truth = run.truth;
    ahead.count = loop_ ? period_ : camera_frame(*info_.frames - 1) + 1;
    const std::uint64_t bytes =
        static_cast<std::uint64_t>(options.width) * static_cast<std::uint64_t>(options.height) *
        ((options.scan == Scan::kInterlaced ? 3u : 6u) + (run.truth ? 4u : 0u)) * period_;
    ahead.keep = loop_ && bytes <= kLoopBytes && options.drift == 0;
    if (ahead.keep) ahead.paced_rate = options.rate;
    if (loop_ && !ahead.keep)
      ahead.count = ~std::uint64_t{0};  // too large to keep, or never the same: rendered anew
    keep_ = ahead.keep;
    frames_ = std::make_unique<sim::RenderAhead>(std::move(renderer), ahead);
  }

  const SourceInfo& info() const override { return info_; }

  Result<std::optional<CapturedFrame>> next() override {
    if (stopped_ || (!loop_ && number_ == *info_.frames)) return std::optional<CapturedFrame>{};
    const std::uint64_t index = camera_frame(number_);
    const auto rendered = frames_->get(keep_ ? index % period_ : index);
    if (!rendered) return std::optional<CapturedFrame>{};
    CapturedFrame frame;
    frame.number = number_++;
    frame.time_ns = std::llround(static_cast<double>(index) * 1e9 / info_.rig.frame_rate);
    frame.scan = info_.rig.scan;
    frame.field_order = info_.rig.field_order;
    frame.picture = rendered->picture.clone();
    frame.complement = rendered->complement.clone();
    truth_ = rendered;
    return std::optional(std::move(frame));
  }

  void request_stop() override {
    stopped_ = true;
    frames_->stop();
  }

  const ImageF& truth() const override { return truth_ ? truth_->truth : none_; }

 private:
  /// The n-th frame that was not lost, counted with the lost ones: of each `drop_`, the last is lost.
  std::uint64_t camera_frame(std::uint64_t n) const { return drop_ ? n + n / (drop_ - 1) : n; }

  const SourceInfo info_;
  const std::uint64_t drop_;
  const bool loop_;
  bool keep_ = false;
  std::uint64_t period_ = 0;
  std::uint64_t number_ = 0;
  std::atomic<bool> stopped_{false};
  std::shared_ptr<const sim::RenderedFrame> truth_;
  const ImageF none_;
  std::unique_ptr<sim::RenderAhead> frames_;  // last: its threads end first
};

Result<Pattern> pattern_of(const sim::SimOptions& options) {
  return make_scheme_pattern(options.scheme, options.base, options.slides, options.first, options.stripes,
                             options.path);
}

}  // namespace

Status check_sim(const std::string& spec) {
  const std::string name = "sim:" + spec;
  const auto options = sim::parse_sim_options(spec);
  if (!options) return options.error().in(name);
  if (const Status known = sim::check_scene(options->scene); !known) return known.error().in(name);
  const auto pattern = pattern_of(*options);
  return pattern ? Status() : pattern.error().in(name);
}

Result<std::unique_ptr<SimSource>> make_sim(const std::string& spec, const SimRun& run) {
  const std::string name = "sim:" + spec;
  const Result<sim::SimOptions> options = sim::parse_sim_options(spec);
  if (!options) return options.error().in(name);
  Result<std::shared_ptr<const sim::Scene>> scene = sim::make_scene(options->scene);
  if (!scene) return scene.error().in(name);
  Result<Pattern> pattern = pattern_of(*options);
  if (!pattern) return pattern.error().in(name);

  SourceInfo info;
  info.name = name;
  info.rig = sim::make_rig(*options, (*scene)->view());
  info.pattern = *std::move(pattern);
  const auto passed = static_cast<std::uint64_t>(options->frames > 0 ? options->frames : options->period);
  // `frames` counts what is delivered; a period counts what the camera took, lost ones too.
  const auto drop = static_cast<std::uint64_t>(options->drop);
  info.frames = options->frames > 0 || drop == 0 ? passed : passed - passed / drop;
  auto renderer = std::make_shared<const sim::Renderer>(*options, info.rig, info.pattern, *std::move(scene));
  return std::unique_ptr<SimSource>(
      std::make_unique<Simulator>(std::move(info), *options, run, std::move(renderer)));
}

Result<std::unique_ptr<FieldSource>> open_sim(const std::string& spec, const SourceOptions& options) {
  Result<std::unique_ptr<SimSource>> source = make_sim(spec, {.loop = options.loop});
  if (!source) return source.error();
  return std::unique_ptr<FieldSource>(*std::move(source));
}

}  // namespace relievo
