// SPDX-License-Identifier: Apache-2.0
#include "server/pace.h"

#include <array>
#include <cstddef>
#include <limits>

namespace relievo {
namespace {

struct Step {
  Rung rung;  // that stands for it: which suits is decided as for a receiver of a stream's qualities
  Pace pace;
  double dearer_above;  // times that the step above takes as long: measured (docs/BENCHMARKS.md)
};
constexpr std::array<Step, 3> kSteps{{{Rung::kFull, {Decoder::kOrdered, 1}, 1},
                                      {Rung::kReduced, {Decoder::kQuick, 1}, 3.7},
                                      {Rung::kTexture, {Decoder::kQuick, 2}, 2}}};

const Step& step_of(Rung rung) {
  for (const Step& step : kSteps)
    if (step.rung == rung) return step;
  return kSteps.front();
}

}  // namespace

std::string to_string(const Pace& pace) {
  return std::string(decoder_name(pace.decoder)) + (pace.line_stride > 1 ? ", every second line" : "");
}

PaceControl::PaceControl()
    // Busy is what the step above would be: a reason to stay, and none to go down.
    : choice_({.most_lost = 0.05,
               .most_busy = std::numeric_limits<double>::infinity(),
               .calm_lost = 0,
               .calm_busy = 0.8,
               .window_ns = 2 * kNanosecondsPerSecond}) {
  choice_.offer({Rung::kReduced, Rung::kTexture});
}

void PaceControl::add(std::int64_t now_ns, double ms, std::uint64_t dropped) {
  const double above_ns = ms * 1e6 * step_of(choice_.now()).dearer_above;
  choice_.add(now_ns, {.arrived = 1, .lost = dropped, .busy_ns = static_cast<std::int64_t>(above_ns)});
}

bool PaceControl::at_least() const {
  return choice_.now() == kSteps.back().rung;
}

Pace PaceControl::now() const {
  return step_of(choice_.now()).pace;
}

}  // namespace relievo
