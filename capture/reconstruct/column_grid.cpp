// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/column_grid.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace relievo {
namespace {

constexpr float kAcross_px = 0.5F;
constexpr float kNoise = 4;        // standard deviations of a column more, for all
constexpr float kAlong_px = 0.4F;  // a row of the camera
constexpr float kLean_px = 1.F;    // a row, where no neighbour is known

bool known(float x) {
  return x == x;
}

}  // namespace

ColumnLimits::ColumnLimits(const ColumnScale& scale) {
  const auto step = static_cast<float>(scale.line_step_px);
  across = kAcross_px + kNoise * scale.noise_px;
  along = kAlong_px * step + kNoise * scale.noise_px;
  lean = kLean_px * step + along;
}

bool surface_goes_on_across(const std::array<float, 4>& x, float gap, const ColumnScale& scale) {
  const float d = (x[2] - x[1]) / gap;
  if (!(d > 0)) return false;
  const float before = x[1] - x[0];
  const float behind = x[3] - x[2];
  const ColumnLimits limits(scale);
  if (known(before) && known(behind)) {
    const float more = limits.across + ColumnLimits::kAcrossShare * d;
    return d >= std::min(before, behind) - more && d <= std::max(before, behind) + more;
  }
  const float one = known(before) ? before : behind;
  if (known(one)) return std::fabs(d - one) <= limits.across + ColumnLimits::kAcrossOpen * std::min(d, one);
  return d <= ColumnLimits::kWidest_px;
}

bool surface_goes_on_along(const std::array<float, 4>& x, float gap, const ColumnScale& scale) {
  const float d = (x[2] - x[1]) / gap;
  const float before = x[1] - x[0];
  const float behind = x[3] - x[2];
  const ColumnLimits limits(scale);
  if (known(before) && known(behind))
    return d >= std::min(before, behind) - limits.along && d <= std::max(before, behind) + limits.along;
  const float one = known(before) ? before : behind;
  if (known(one)) return std::fabs(d - one) <= limits.along;
  return std::fabs(d) <= limits.lean;
}

void find_holes(int size, const ColumnScale& scale, const DecodedGrid& grid, std::vector<Hole>& out) {
  out.clear();
  if (size <= 0) return;
  struct Found {
    float column_px;
    int gap;
  };
  // `at(i)` is the place i further on, 0 the hole itself.
  using GoesOn = bool(const std::array<float, 4>&, float, const ColumnScale&);
  const auto between = [&](const auto& at, GoesOn& goes_on) -> std::optional<Found> {
    for (int before = 1; before <= size; ++before) {
      if (!known(at(-before))) continue;
      for (int behind = 1; before + behind - 1 <= size; ++behind) {
        if (!known(at(behind))) continue;
        const int gap = before + behind;
        const float x1 = at(-before);
        const float x2 = at(behind);
        if (!goes_on({at(-before - 1), x1, x2, at(behind + 1)}, static_cast<float>(gap), scale))
          return std::nullopt;
        const float share = static_cast<float>(before) / static_cast<float>(gap);
        return Found{x1 + share * (x2 - x1), gap};
      }
      return std::nullopt;
    }
    return std::nullopt;
  };
  for (int l = 0; l < grid.lines(); ++l) {
    for (int b = 0; b < grid.boundaries(); ++b) {
      const float* here = grid.column_px(l);
      if (known(here[b])) continue;
      const auto across =
          between([&](int i) { return b + i < 0 || b + i >= grid.boundaries() ? kNoColumn : here[b + i]; },
                  surface_goes_on_across);
      const auto along = between(
          [&](int i) { return l + i < 0 || l + i >= grid.lines() ? kNoColumn : grid.column_px(l + i)[b]; },
          surface_goes_on_along);
      if (!across && !along) continue;
      const bool use_along = along && (!across || along->gap <= across->gap);
      out.push_back({static_cast<std::uint16_t>(b), static_cast<std::uint16_t>(l),
                     use_along ? along->column_px : across->column_px});
    }
  }
}

}  // namespace relievo
