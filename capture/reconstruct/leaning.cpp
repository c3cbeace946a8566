// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/leaning.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace relievo {
namespace {

constexpr float kSameBoundary_px = 2.5F;  // as far as one moves from a line to the next
constexpr float kStraight_px = 0.5F;      // between its moves from above and to below: it may be bent
constexpr float kNoise = 0.1F;            // of a rise: less is mostly noise
constexpr float kMostRise = 1.F;          // a line: at a rim, beyond which there is nothing
// Variance, in lines, of what a place is a mean over.
constexpr float kOfLowPass = 0.5F;    // [1 2 1] / 4
constexpr float kOfBetween = 0.125F;  // half of the difference is a mean of two rows, half a line off each
constexpr float kOfFading = 0.5F;     // once more
constexpr float kOfWeak = 2.5F;       // [1 2 3 4 3 2 1] / 16 of weak_signal.h

bool apart(float a, float b) {
  return !(std::fabs(a - b) < kSameBoundary_px);
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

void LeanCorrection::correct(const DifferenceImage& image, bool between, int boundaries,
                             const SequenceResult& result, WorkerPool& pool, EdgeImage& edges) {
  seen_.reset(boundaries, edges.lines, {});
  const auto each_of = [&](int line, auto act) {
    for (std::uint32_t e = edges.line_start[static_cast<std::size_t>(line)];
         e < edges.line_start[static_cast<std::size_t>(line) + 1]; ++e)
      if (result.boundary[e] >= 0) act(edges.edges[e], seen_.line(line) + result.boundary[e]);
  };
  const auto in_all = [&](auto act) {
    pool.for_ranges(edges.lines, [&](int begin, int end, int) {
      for (int line = begin; line < end; ++line)
        each_of(line, [&](Edge& edge, Seen* seen) { act(line, edge, *seen); });
    });
  };
  in_all([](int, const Edge& edge, Seen& seen) { seen = {edge.column_px, edge.slope}; });
  const float strong = kOfLowPass + (between ? kOfBetween : 0);
  in_all([&](int line, Edge& edge, const Seen& seen) {
    const Signal signal = image.signal_at(line, static_cast<int>(edge.column_px));
    const float averaged = signal == Signal::kWeak ? kOfWeak : signal == Signal::kFading ? kOfFading : 0;
    edge.column_px -= (strong + averaged) * drawn_px(&seen, seen_.stride());
  });
}

}  // namespace relievo
