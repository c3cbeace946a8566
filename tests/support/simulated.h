// SPDX-License-Identifier: Apache-2.0
// A simulated rig and what its camera sees.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "capture/pattern/bcsl.h"
#include "capture/source/sim/renderer.h"
#include "capture/source/sim/scene.h"

namespace relievo::test {

struct Simulated {
  /// As behind `sim:`; it must be right.
  explicit Simulated(const std::string& spec)
      : options(*sim::parse_sim_options(spec)),
        scene(*sim::make_scene(options.scene)),
        rig(sim::make_rig(options, scene->view())),
        pattern(*make_pattern(options.base, options.slides, options.first, options.stripes, options.path)),
        renderer(options, rig, pattern, scene) {}

  CapturedFrame frame(std::uint64_t number) const {
    sim::RenderedFrame rendered = renderer.render(number, false);
    CapturedFrame out;
    out.number = number;
    out.time_ns = std::llround(static_cast<double>(number) * 1e9 / rig.frame_rate);
    out.scan = rig.scan;
    out.picture = std::move(rendered.picture);
    out.complement = std::move(rendered.complement);
    return out;
  }

  sim::SimOptions options;
  std::shared_ptr<const sim::Scene> scene;
  Rig rig;
  Pattern pattern;
  sim::Renderer renderer;
};

}  // namespace relievo::test
