// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/column_grid.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

namespace relievo {
namespace {

// How far a difference may lie outside those of its neighbours. At a crease it lies between them.
constexpr float kAcross_px = 0.5F;
constexpr float kAcrossShare = 0.15F;  // of the difference more
constexpr float kAcrossOpen = 0.35F;   // the same where only one neighbour is known
constexpr float kNoise = 4;            // standard deviations of a column more, for all
constexpr float kWidest_px = 64.F;     // across, where none is
constexpr float kAlong_px = 0.4F;      // a row of the camera
constexpr float kLean_px = 1.F;        // a row, where no neighbour is known

bool known(float x) {
  return x == x;
}

}  // namespace

bool surface_goes_on_across(const std::array<float, 4>& x, float gap, const ColumnScale& scale) {
  const float d = (x[2] - x[1]) / gap;
  if (!(d > 0)) return false;
  const float before = x[1] - x[0];
  const float behind = x[3] - x[2];
  const float slack = kAcross_px + kNoise * scale.noise_px;
  if (known(before) && known(behind)) {
    const float more = slack + kAcrossShare * d;
    return d >= std::min(before, behind) - more && d <= std::max(before, behind) + more;
  }
  const float one = known(before) ? before : behind;
  if (known(one)) return std::fabs(d - one) <= slack + kAcrossOpen * std::min(d, one);
  return d <= kWidest_px;
}

bool surface_goes_on_along(const std::array<float, 4>& x, float gap, const ColumnScale& scale) {
  const float d = (x[2] - x[1]) / gap;
  const float before = x[1] - x[0];
  const float behind = x[3] - x[2];
  const auto step = static_cast<float>(scale.line_step_px);
  const float slack = kAlong_px * step + kNoise * scale.noise_px;
  if (known(before) && known(behind))
    return d >= std::min(before, behind) - slack && d <= std::max(before, behind) + slack;
  const float one = known(before) ? before : behind;
  if (known(one)) return std::fabs(d - one) <= slack;
  return std::fabs(d) <= kLean_px * step + slack;
}

void find_links(const ColumnGrid& grid, const ColumnScale& scale, WorkerPool& pool, GridLinks& out) {
  const std::size_t cells =
      static_cast<std::size_t>(grid.boundaries()) * static_cast<std::size_t>(grid.lines());
  out.across.assign(cells, 0);
  out.along.assign(cells, 0);
  std::atomic<std::size_t> steps{0};
  pool.for_ranges(grid.lines(), [&](int begin, int end, int) {
    std::size_t own_steps = 0;
    for (int l = begin; l < end; ++l) {
      const float* here = grid.line(l);
      const float* above = grid.line(l - 1);
      const float* below = grid.line(l + 1);
      const float* further = grid.line(l + 2);
      const std::size_t row = static_cast<std::size_t>(l) * static_cast<std::size_t>(grid.boundaries());
      for (int b = 0; b < grid.boundaries(); ++b) {
        if (!known(here[b])) continue;
        const std::size_t cell = row + static_cast<std::size_t>(b);
        if (known(here[b + 1])) {
          const bool on = surface_goes_on_across({here[b - 1], here[b], here[b + 1], here[b + 2]}, 1, scale);
          out.across[cell] = on;
          own_steps += !on;
        }
        if (known(below[b])) {
          const bool on = surface_goes_on_along({above[b], here[b], below[b], further[b]}, 1, scale);
          out.along[cell] = on;
          own_steps += !on;
        }
      }
    }
    steps += own_steps;
  });
  out.steps = steps;
}

void fill_holes(int size, const ColumnScale& scale, ColumnGrid& grid, std::vector<Hole>& out) {
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
      const float* here = grid.line(l);
      if (known(here[b])) continue;
      const auto across =
          between([&](int i) { return b + i < 0 || b + i >= grid.boundaries() ? kNoColumn : here[b + i]; },
                  surface_goes_on_across);
      const auto along =
          between([&](int i) { return l + i < 0 || l + i >= grid.lines() ? kNoColumn : grid.line(l + i)[b]; },
                  surface_goes_on_along);
      if (!across && !along) continue;
      const bool use_along = along && (!across || along->gap <= across->gap);
      out.push_back({static_cast<std::uint16_t>(b), static_cast<std::uint16_t>(l),
                     use_along ? along->column_px : across->column_px});
    }
  }
  for (const Hole& h : out) grid.line(h.line)[h.boundary] = h.column_px;
}

}  // namespace relievo
