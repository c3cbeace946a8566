// SPDX-License-Identifier: Apache-2.0
#include "bench/still_scene.h"

#include <memory>
#include <utility>

#include "capture/calibrate/pictures.h"
#include "capture/pattern/bcsl.h"
#include "capture/pattern/gray_code.h"
#include "capture/source/sim/renderer.h"

namespace relievo::bench {
namespace {

constexpr double kLitLevels = 1;  // of 255, by which white must be brighter than black where nothing is noisy

/// Gray code as slides of black and white stripes, one a projector column, the coarsest bit first.
Pattern gray_pattern(int columns) {
  Pattern out{.base = 2, .slides = gray_bits(columns), .palette = {0, 7}, .sequence = {}};
  for (int i = 0; i < columns; ++i)
    out.sequence.push_back(static_cast<int>(gray_from_binary(static_cast<std::uint32_t>(i))));
  return out;
}

/// One stripe: the whole projector is white, in the complement black.
Pattern white_pattern() {
  return {.base = 2, .slides = 1, .palette = {0, 7}, .sequence = {1, 1}};
}

/// The same rig with its projector rolled by a quarter: what were rows are columns (x' = y, y' = -x), so that
/// the simulator, whose stripes lie along columns, lights the scene along rows.
Rig rolled(const Rig& rig) {
  Rig out = rig;
  const PinholeModel& p = rig.projector;
  out.projector.width = p.height;
  out.projector.height = p.width;
  out.projector.matrix = {p.fy(), 0, p.cy(), 0, p.fx(), p.width - 1 - p.cx(), 0, 0, 1};
  const auto& k = p.distortion;
  out.projector.distortion = {k[0], k[1], -k[3], k[2], k[4]};
  const auto& r = rig.projector_from_camera_rotation;
  out.projector_from_camera_rotation = {r[3], r[4], r[5], -r[0], -r[1], -r[2], r[6], r[7], r[8]};
  const auto& t = rig.projector_from_camera_translation;
  out.projector_from_camera_translation = {t[1], -t[0], t[2]};
  return out;
}

class StillRenderer {
 public:
  StillRenderer(const sim::SimOptions& options, std::shared_ptr<const sim::Scene> scene,
                const StopSignal& stop)
      : options_(options), scene_(std::move(scene)), stop_(stop) {}

  /// Every slide of the pattern with its complement; the first one alone once it is stopped.
  std::vector<sim::RenderedFrame> under(const Rig& rig, const Pattern& pattern, bool noise = true) const {
    sim::SimOptions options = options_;
    if (!noise) options.noise = 0;
    const sim::Renderer renderer(options, rig, pattern, scene_);
    std::vector<sim::RenderedFrame> out;
    for (int slide = 0; slide == 0 || (slide < pattern.slides && !stop_.stopped()); ++slide)
      out.push_back(renderer.render(static_cast<std::uint64_t>(slide), slide == 0));
    return out;
  }

 private:
  sim::SimOptions options_;
  std::shared_ptr<const sim::Scene> scene_;
  const StopSignal& stop_;
};

/// Coarsest bit first in, [bit] out.
std::vector<GrayPair> pairs_of(const std::vector<sim::RenderedFrame>& frames) {
  std::vector<GrayPair> out;
  for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame)
    out.push_back({grey_of(frame->picture), grey_of(frame->complement)});
  return out;
}

}  // namespace

Result<StillScene> render_still_scene(const std::string& spec, const StopSignal& stop) {
  auto options = sim::parse_sim_options(spec);
  if (!options) return options.error();
  auto scene = sim::make_scene(options->scene);
  if (!scene) return scene.error();
  auto pattern =
      make_pattern(options->base, options->slides, options->first, options->stripes, options->path);
  if (!pattern) return pattern.error();
  options->scan = Scan::kProgressive;
  options->period = 1'000'000'000;  // frames: nothing moves
  StillScene out;
  out.rig = sim::make_rig(*options, (*scene)->view());
  out.pattern = *std::move(pattern);
  const StillRenderer renderer(*options, *scene, stop);

  std::uint64_t number = 0;
  for (sim::RenderedFrame& rendered : renderer.under(out.rig, out.pattern)) {
    CapturedFrame& frame = out.stripes.emplace_back();
    frame.number = number++;
    frame.scan = Scan::kProgressive;
    frame.picture = std::move(rendered.picture);
    frame.complement = std::move(rendered.complement);
    if (!rendered.truth.empty()) out.truth = std::move(rendered.truth);
  }
  out.gray.projector_width = out.rig.projector.width;
  out.gray.projector_height = out.rig.projector.height;
  out.gray.columns = pairs_of(renderer.under(out.rig, gray_pattern(out.rig.projector.width)));
  out.gray.rows = pairs_of(renderer.under(rolled(out.rig), gray_pattern(out.rig.projector.height)));
  auto white = renderer.under(out.rig, white_pattern());
  out.white = grey_of(white[0].picture);
  out.black = grey_of(white[0].complement);
  out.gray.picture = std::move(white[0].picture);
  const auto clean = renderer.under(out.rig, white_pattern(), false);
  const Image8 bright = grey_of(clean[0].picture), dark = grey_of(clean[0].complement);
  for (std::size_t i = 0; i < bright.size(); ++i)
    out.lit.push_back(out.truth.data()[i] > 0 && bright.data()[i] - dark.data()[i] > kLitLevels ? 1 : 0);
  return out;
}

}  // namespace relievo::bench
