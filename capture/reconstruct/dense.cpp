// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/dense.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/eight.h"

namespace relievo {
namespace {

// A knot this near makes its pixel a measured one; so far a piece of surface reaches beyond its last knots.
constexpr float kHalfPixel = 0.5F;
// Of the difference between the widths of neighbouring intervals: how far off a pixel half way may be.
constexpr float kBendShare = 0.25F;

}  // namespace

/// A cubic through the knots (Hermite), with slopes from the parabola through three, limited so that the
/// column of the projector never falls (Fritsch and Carlson).
void DenseSampler::sample_piece(int first_boundary, int line, const Triangulator& triangulator,
                                Scratch& scratch, DenseGrid& out) {
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

  DecodedGrid& pixels = out.pixels;
  const PointRow points = pixels.points(line);
  std::uint8_t* interpolated_row = pixels.interpolated_of(line);
  std::uint16_t* boundaries = out.boundaries.data() + static_cast<std::size_t>(line) * pixels.stride();
  const int begin = std::max(0, static_cast<int>(std::ceil(knots[0].column_px - kHalfPixel)));
  const int last =
      std::min(pixels.boundaries() - 1, static_cast<int>(std::floor(knots[n - 1].column_px + kHalfPixel)));
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
    const bool known = left.sigma_px > 0 && right.sigma_px > 0;  // of a filled one none is
    const float sigma_px = known ? std::sqrt(sl * sl + sr * sr + bend * bend) : 0;
    const float slope = (nearer_left ? left : right).slope_px;
    ++(interpolated ? scratch.counts.interpolated : scratch.counts.measured);
    const bool steeper = !(pixels.slope(line)[x] >= slope);
    const bool alone = pixels.put(line, x, column, sigma_px, slope);
    scratch.counts.duplicate += !alone;
    if (!alone && !steeper) continue;
    points.x[x] = (*position)[0];
    points.y[x] = (*position)[1];
    points.z[x] = (*position)[2];
    interpolated_row[x] = interpolated;
    boundaries[x] = static_cast<std::uint16_t>(boundary);
  }
}

DenseCounts DenseSampler::sample(const DecodedGrid& measured, const GridLinks& links,
                                 const Triangulator& triangulator, int width_px, WorkerPool& pool,
                                 DenseGrid& out) {
  DecodedGrid& pixels = out.pixels;
  if (pixels.boundaries() != width_px || pixels.lines() != measured.lines()) {
    pixels.reset(width_px, measured.lines());
    pixels.start_interpolated();
    out.boundaries.resize(static_cast<std::size_t>(measured.lines()) * pixels.stride());
  }
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) s.counts = {};
  pool.for_ranges(measured.lines(), [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    for (int line = begin; line < end; ++line) {
      pixels.start_line(line);
      std::fill_n(pixels.points(line).z, width_px, kNoColumn);
      const float* z = measured.z(line);
      const std::uint8_t* across = links.across(line);
      const std::uint8_t* filled = measured.interpolated(line);
      scratch.knots.clear();
      for (int b = 0; b < measured.boundaries(); ++b) {
        if (!(z[b] > 0)) continue;
        scratch.knots.push_back({measured.column_px(line)[b], measured.sigma_px(line)[b], 0,
                                 measured.slope(line)[b], filled != nullptr && filled[b] != 0});
        if (bit_of(across, b) && z[b + 1] > 0) continue;
        sample_piece(b + 1 - static_cast<int>(scratch.knots.size()), line, triangulator, scratch, out);
        scratch.knots.clear();
      }
    }
  });
  DenseCounts total;
  for (const Scratch& s : scratch_) {
    total.measured += s.counts.measured;
    total.interpolated += s.counts.interpolated;
    total.alone += s.counts.alone;
    total.duplicate += s.counts.duplicate;
  }
  return total;
}

}  // namespace relievo
