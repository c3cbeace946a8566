// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/dense.h"

#include <algorithm>
#include <cmath>

namespace relievo {
namespace {

// A knot this near makes its pixel a measured one; so far a piece of surface reaches beyond its last knots.
constexpr float kHalfPixel = 0.5F;
// Of the difference between the widths of neighbouring intervals: how far off a pixel half way may be.
constexpr float kBendShare = 0.25F;

}  // namespace

/// A cubic through the knots (Hermite), with slopes from the parabola through three, limited so that the
/// column of the projector never falls (Fritsch and Carlson).
void DenseSampler::sample_piece(int first_boundary, int line, const Triangulator& triangulator, int width_px,
                                Scratch& scratch) {
  auto& knots = scratch.knots;
  const std::size_t n = knots.size();
  if (n < 2) {
    scratch.counts.alone += n;
    return;
  }
  const auto width = [&](std::size_t i) { return knots[i + 1].column_px - knots[i].column_px; };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const float a = width(i - 1);
    const float b = width(i);
    knots[i].slope = std::min((b / a + a / b) / (a + b), 3 / std::max(a, b));
  }
  const auto end = [&](std::size_t i, std::size_t inner, float w) {
    knots[i].slope = n > 2 ? std::clamp(2 / w - knots[inner].slope, 0.F, 3 / w) : 1 / w;
  };
  end(0, 1, width(0));
  end(n - 1, n - 2, width(n - 2));

  const int begin = std::max(0, static_cast<int>(std::ceil(knots[0].column_px - kHalfPixel)));
  const int last = std::min(width_px - 1, static_cast<int>(std::floor(knots[n - 1].column_px + kHalfPixel)));
  std::size_t i = 0;
  for (int x = begin; x <= last; ++x) {
    const auto column = static_cast<float>(x);
    while (i + 2 < n && knots[i + 1].column_px <= column) ++i;
    const Knot& left = knots[i];
    const Knot& right = knots[i + 1];
    const float w = width(i);
    const float t = (column - left.column_px) / w;
    float place = 0;  // boundaries beyond `left`
    if (t < 0) {
      place = t * w * left.slope;
    } else if (t > 1) {
      place = 1 + (t - 1) * w * right.slope;
    } else {
      place = t * t * (3 - 2 * t) + w * t * (1 - t) * ((1 - t) * left.slope - t * right.slope);
    }
    const int boundary = first_boundary + static_cast<int>(i);
    const auto position = triangulator.point(boundary, place, line, column);
    if (!position) continue;
    const float to_knot = std::min(std::fabs(column - left.column_px), std::fabs(right.column_px - column));
    const bool nearer_left = t < 0.5F;
    const bool interpolated = to_knot > kHalfPixel || (nearer_left ? left : right).filled;
    const float a = i > 0 ? width(i - 1) : w;
    const float b = i + 2 < n ? width(i + 1) : w;
    const float inner = std::clamp(t, 0.F, 1.F);
    const float bend = inner * (1 - inner) * kBendShare * std::fabs(a - b);
    const float sl = (1 - inner) * left.sigma_px;
    const float sr = inner * right.sigma_px;
    GridVertex v;
    v.at = {.boundary = static_cast<std::uint16_t>(boundary),
            .line = static_cast<std::uint16_t>(line),
            .column_px = column,
            .sigma_px = left.sigma_px > 0 ? std::sqrt(sl * sl + sr * sr + bend * bend) : 0,
            .interpolated = interpolated};
    v.position = *position;
    v.slope = (nearer_left ? left : right).slope_px;
    scratch.vertices.push_back(v);
    ++(interpolated ? scratch.counts.interpolated : scratch.counts.measured);
  }
}

DenseCounts DenseSampler::sample(const std::vector<GridVertex>& measured, const ColumnGrid& columns,
                                 const GridLinks& links, const Triangulator& triangulator, int width_px,
                                 WorkerPool& pool, std::vector<GridVertex>& out) {
  const int boundaries = columns.boundaries();
  const auto cell = [&](int line, int boundary) {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(boundaries) +
           static_cast<std::size_t>(boundary);
  };
  vertex_.assign(cell(columns.lines(), 0), -1);
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const GridPoint& at = measured[i].at;
    if (columns.line(at.line)[at.boundary] == at.column_px)
      vertex_[cell(at.line, at.boundary)] = static_cast<std::int32_t>(i);
  }
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  for (Scratch& s : scratch_) {
    s.vertices.clear();
    s.counts = {};
  }
  pool.for_ranges(columns.lines(), [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      scratch.knots.clear();
      for (int b = 0; b < boundaries; ++b) {
        const std::int32_t i = vertex_[cell(line, b)];
        if (i < 0) continue;
        const GridVertex& v = measured[static_cast<std::size_t>(i)];
        scratch.knots.push_back({v.at.column_px, v.at.sigma_px, 0, v.slope, v.at.interpolated});
        if (links.across[cell(line, b)] != 0 && b + 1 < boundaries && vertex_[cell(line, b + 1)] >= 0)
          continue;
        sample_piece(b + 1 - static_cast<int>(scratch.knots.size()), line, triangulator, width_px, scratch);
        scratch.knots.clear();
      }
    }
  });
  out.clear();
  DenseCounts total;
  for (const Scratch& s : scratch_) {
    out.insert(out.end(), s.vertices.begin(), s.vertices.end());
    total.measured += s.counts.measured;
    total.interpolated += s.counts.interpolated;
    total.alone += s.counts.alone;
  }
  return total;
}

}  // namespace relievo
