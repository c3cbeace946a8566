// SPDX-License-Identifier: Apache-2.0
// A simulated rig and what its camera sees.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "capture/pattern/repeating.h"
#include "capture/source/sim/renderer.h"
#include "capture/source/sim/scene.h"

namespace relievo::test {

struct Simulated {
  /// As behind `sim:`, or of another scene than that.
  explicit Simulated(const std::string& spec, std::shared_ptr<const sim::Scene> other = nullptr)
      : options(valid(sim::parse_sim_options(spec))),
        scene(other ? std::move(other) : valid(sim::make_scene(options.scene))),
        rig(sim::make_rig(options, scene->view())),
        pattern(valid(make_scheme_pattern(options.scheme, options.base, options.slides, options.first,
                                          options.stripes, options.path))),
        renderer(options, rig, pattern, scene) {}

  /// `truth` gets the depths.
  CapturedFrame frame(std::uint64_t number, ImageF* truth = nullptr) const {
    sim::RenderedFrame rendered = renderer.render(number, truth != nullptr);
    if (truth != nullptr) *truth = std::move(rendered.truth);
    CapturedFrame out;
    out.number = number;
    out.time_ns = std::llround(static_cast<double>(number) * 1e9 / rig.frame_rate);
    out.scan = rig.scan;
    out.field_order = rig.field_order;
    out.picture = std::move(rendered.picture);
    out.complement = std::move(rendered.complement);
    return out;
  }

  sim::SimOptions options;
  std::shared_ptr<const sim::Scene> scene;
  Rig rig;
  Pattern pattern;
  sim::Renderer renderer;

 private:
  template <class T>
  static T valid(Result<T> made) {
    EXPECT_TRUE(made) << made.error().message;
    return *std::move(made);
  }
};

}  // namespace relievo::test
