// SPDX-License-Identifier: Apache-2.0
#include "server/pace.h"

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

namespace relievo {
namespace {

struct Step {
  Rung rung;  // that stands for it: which suits is decided as for a receiver of a stream's qualities
  Pace pace;
  double dearer_above;  // times that the step above takes as long: measured (docs/BENCHMARKS.md)
};
constexpr std::array<Step, 4> kSteps{{{Rung::kFull, {Decoder::kOrdered, 1}, 1},
                                      {Rung::kReduced, {Decoder::kQuick, 1}, 3.7},
                                      {Rung::kTexture, {Decoder::kQuick, 2}, 2},
                                      {Rung::kSlow, {Decoder::kQuick, 4}, 2}}};
constexpr int kLeastLines = 100;  // that are left

const Step& step_of(Rung rung) {
  for (const Step& step : kSteps)
    if (step.rung == rung) return step;
  return kSteps.front();
}

}  // namespace

std::string to_string(const Pace& pace) {
  const char* const lines[] = {"", ", every second line", ", every fourth line"};
  return std::string(decoder_name(pace.decoder)) + lines[pace.line_stride / 2];
}

PaceControl::PaceControl(int lines)
    // Busy is what the step above would be: a reason to stay, and none to go down.
    : choice_({.most_lost = 0.05,
               .most_busy = std::numeric_limits<double>::infinity(),
               .calm_lost = 0,
               .calm_busy = 0.8,
               .window_ns = 2 * kNanosecondsPerSecond}) {
  std::vector<Rung> offered;
  for (const Step& step : kSteps) {
    if (step.pace.line_stride > 1 && lines / step.pace.line_stride < kLeastLines) continue;
    offered.push_back(step.rung);
    least_ = step.rung;
  }
  choice_.offer(offered);
}

void PaceControl::add(std::int64_t now_ns, double ms, std::uint64_t dropped) {
  const double above_ns = ms * 1e6 * step_of(choice_.now()).dearer_above;
  choice_.add(now_ns, {.arrived = 1, .lost = dropped, .busy_ns = static_cast<std::int64_t>(above_ns)});
}

bool PaceControl::at_least() const {
  return choice_.now() == least_;
}

Pace PaceControl::now() const {
  return step_of(choice_.now()).pace;
}

}  // namespace relievo
