// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/leaning.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "capture/reconstruct/place_rules.h"

namespace relievo {
namespace {

constexpr float kSameBoundary_px = 2.5F;  // as far as one moves from a line to the next
constexpr float kStraight_px = 0.5F;      // between its moves from above and to below: it may be bent
constexpr float kNoise = 0.1F;            // of a rise: less is mostly noise
constexpr float kMostRise = 1.F;          // a line: at a rim, beyond which there is nothing
// Variance, in lines, of what a place is a mean over.
constexpr float kOfLowPass = 0.5F;  // [1 2 1] / 4
constexpr float kOfFading = 0.5F;   // once more
constexpr float kOfWeak = 2.5F;     // [1 2 3 4 3 2 1] / 16 of weak_signal.h

constexpr float kBrighter = 1.8F;   // times: a line beside it whose edge may be what is seen
constexpr float kOwnShare = 0.35F;  // of that edge's height, that the line has at least of its own
constexpr int kBeside = 3;          // pixels to each side of an edge that its height is measured over
// Standard deviation of a height of one channel, of a low-passed difference's: its variance is that of the
// mean of so many pixels, twice, and the low-pass [1 2 1] both ways leaves 0.375 squared of it.
constexpr float kHeightNoise = 2.18F;

bool apart(float a, float b) {
  return !(std::fabs(a - b) < kSameBoundary_px);
}

using Height = std::array<float, 3>;  // of an edge, grey levels of the difference in each channel

/// On the line itself, before any low-pass. 0 where the picture ends.
Height height(const DetectionLines& rows, int line, float column_px) {
  Height out{};
  const int x = place_rules::column_of(column_px);
  if (x < kBeside || x + kBeside >= rows.own.width) return out;
  const std::uint8_t* own = rows.own.row(line);
  const std::uint8_t* above = rows.other_above(line);
  const std::uint8_t* below = rows.other_below(line);
  for (int channel = 0; channel < 3; ++channel) {
    const auto twice = [&](int column) {
      const int i = 3 * column + channel;
      return 2 * own[i] - above[i] - below[i];
    };
    int sum = 0;
    for (int k = 1; k <= kBeside; ++k) sum += twice(x + k) - twice(x - k);
    out[static_cast<std::size_t>(channel)] = static_cast<float>(sum) / (2 * kBeside);
  }
  return out;
}

}  // namespace

/// How far the place of a boundary is drawn along the line for each line squared of the mean's variance: how
/// far it moves to the next line, times the share by which brightness rises to there. An edge is the steeper
/// the brighter it is.
float LeanCorrection::drawn_px(const Seen* here, std::ptrdiff_t stride) {
  const Seen& above = here[-stride];
  const Seen& below = here[stride];
  const float from_above =
      apart(above.column_px, here->column_px) ? kNoColumn : here->column_px - above.column_px;
  const float to_below =
      apart(below.column_px, here->column_px) ? kNoColumn : below.column_px - here->column_px;
  float lean, rise;
  if (std::isnan(from_above) || std::isnan(to_below)) {
    const bool down = std::isnan(from_above);
    lean = down ? to_below : from_above;
    if (std::isnan(lean)) return 0;
    const float next = down ? below.slope : above.slope;
    rise = 2 * (down ? next - here->slope : here->slope - next) / (next + here->slope);
  } else {
    lean = 0.5F * (from_above + to_below);
    // Beside a step between lines one of the two is the step's.
    if (std::fabs(to_below - from_above) > kStraight_px)
      lean = from_above * to_below <= 0                    ? 0
             : std::fabs(from_above) < std::fabs(to_below) ? from_above
                                                           : to_below;
    rise = (below.slope - above.slope) / (0.5F * (above.slope + below.slope) + here->slope);
  }
  rise *= rise * rise / (rise * rise + kNoise * kNoise);
  return lean * std::clamp(rise, -kMostRise, kMostRise);
}

/// Beside a step on one side only the other exposure's row on the other side was taken: how far, for each
/// line that it lies off, the place is from where the line has it.
float LeanCorrection::one_sided_px(const Seen* here, std::ptrdiff_t stride, std::uint8_t sides) {
  if (sides != LineSteps::kAbove && sides != LineSteps::kBelow) return 0;
  const Seen& next = here[sides == LineSteps::kBelow ? -stride : stride];  // on its surface
  if (apart(next.column_px, here->column_px)) return 0;
  return 0.5F * (here->column_px - next.column_px);
}

/// Whether a line beside it, mixed in by the low-pass, shows the edge and its own line does not.
bool LeanCorrection::is_borrowed(const DetectionLines& rows, float noise, int line, const Seen* here) const {
  for (const int step : {-1, 1}) {
    const Seen& next = here[step * seen_.stride()];
    if (apart(next.column_px, here->column_px) || next.slope < kBrighter * here->slope) continue;
    const Height own = height(rows, line, here->column_px);
    const Height beside = height(rows, line + step, next.column_px);
    float product = 0, square = 0;
    for (std::size_t i = 0; i < own.size(); ++i) {
      product += own[i] * beside[i];
      square += beside[i] * beside[i];
    }
    if (product + kHeightNoise * noise * std::sqrt(square) < kOwnShare * square) return true;
  }
  return false;
}

std::size_t LeanCorrection::correct(const DetectionLines& rows, const DifferenceImage& image, int boundaries,
                                    WorkerPool& pool, SequenceResult& result, EdgeImage& edges) {
  seen_.reset(boundaries, edges.lines, {});
  const auto in_all = [&](auto act) {
    pool.for_ranges(edges.lines, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line)
        for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
             e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
          if (result.boundary[e] >= 0) act(line, e, seen_.line(line) + result.boundary[e]);
    });
  };
  in_all([&](int, std::uint32_t e, Seen* seen) { *seen = {edges.edges[e].column_px, edges.edges[e].slope}; });
  std::atomic<std::size_t> borrowed{0};
  // Half of the difference is the other exposure: the mean of two rows.
  const float strong = kOfLowPass + 0.5F * rows.below * rows.below;
  in_all([&](int line, std::uint32_t e, const Seen* seen) {
    Edge& edge = edges.edges[e];
    if (is_borrowed(rows, image.noise, line, seen)) {
      result.boundary[e] = -1;
      ++borrowed;
      return;
    }
    const int x = static_cast<int>(edge.column_px);
    const Signal signal = image.signal_at(line, x);
    const float averaged = signal == Signal::kWeak ? kOfWeak : signal == Signal::kFading ? kOfFading : 0;
    const std::uint8_t sides = image.steps.at(line, x);
    const float over_lines = averaged + (sides == 0 ? strong : 0);
    edge.column_px -=
        over_lines * drawn_px(seen, seen_.stride()) - rows.below * one_sided_px(seen, seen_.stride(), sides);
  });
  return borrowed;
}

}  // namespace relievo
