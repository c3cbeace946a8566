// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_difference.h"

#include <algorithm>
#include <cmath>

#include "capture/reconstruct/place_rules.h"

namespace relievo {
namespace {

/// Largest value of one RGB row after the low-pass along the line ([1 2 1] / 4) and the colour matrix (Eq.
/// 3).
float largest_of_row(const std::uint8_t* rgb, int width, const std::array<float, 9>& m) {
  float largest = 0;
  const auto take = [&](float r, float g, float b) {
    largest = std::max({largest, m[0] * r + m[1] * g + m[2] * b, m[3] * r + m[4] * g + m[5] * b,
                        m[6] * r + m[7] * g + m[8] * b});
  };
  for (int x = 1; x + 1 < width; ++x) {
    const std::uint8_t* p = rgb + 3 * x;
    const auto low_pass = [&](int c) { return 0.25F * static_cast<float>(p[c - 3] + 2 * p[c] + p[c + 3]); };
    take(low_pass(0), low_pass(1), low_pass(2));
  }
  for (const int x : {0, width - 1}) take(rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2]);
  return largest;
}

float estimate_noise(const DifferenceImage& image) {
  constexpr float kPerBin = 1.F / 16;
  return place_rules::noise_across_lines(
      image, 7, kPerBin, [&](const float* above, const float* here, const float* below, auto& seconds) {
        for (int i = 0; i < 3 * image.width; i += 5) {
          const float second = std::fabs(above[i] - 2 * here[i] + below[i]);
          seconds.add(static_cast<std::size_t>(second / kPerBin));
        }
      });
}

/// Tells `each` the samples [first, last) of a line's blocks beside steps, and which those are.
template <class Each>
void for_steps(const LineSteps& steps, int line, const Each& each) {
  if (!steps.beside(line)) return;
  constexpr int kSamples = 3 * LineSteps::kBlock_px;
  for (int block = 0; block < steps.blocks; ++block)
    if (const std::uint8_t sides = steps.of_block(line, block); sides != 0)
      each(kSamples * block, kSamples * (block + 1), sides);
}

/// `out` is `row` of RGB where columns are `share` of `motion_px` further on, its ends beyond them.
void shift_row(const std::uint8_t* row, const float* motion_px, float share, int width, std::uint8_t* out) {
  std::copy_n(row, 3 * static_cast<std::size_t>(width), out);  // most holds still on most lines
  for (int x = 0; x < width; ++x) {
    if (motion_px[x] == 0) continue;
    const float from =
        std::clamp(static_cast<float>(x) + share * motion_px[x], 0.F, static_cast<float>(width) - 1.001F);
    const int first = static_cast<int>(from);
    const auto part = static_cast<int>(256 * (from - static_cast<float>(first)));
    const std::uint8_t* p = row + 3 * first;
    for (int c = 0; c < 3; ++c)
      out[3 * x + c] = static_cast<std::uint8_t>((p[c] * (256 - part) + p[c + 3] * part + 128) >> 8);
  }
}

}  // namespace

Differencer::Differencer(const std::array<double, 9>& colour_matrix) {
  constexpr float kScale = 1 / RowKernels::kLowPassed;
  for (std::size_t i = 0; i < 9; ++i) {
    matrix_[i] = static_cast<float>(colour_matrix[i]);
    weights_.colour[i] = matrix_[i] * kScale;
  }
  weights_.luma = {0.299F * kScale, 0.587F * kScale, 0.114F * kScale};  // Rec. 601, of the captured colours
}

void Differencer::difference_of_lines(const DetectionLines& rows, int begin, int end, Scratch& scratch,
                                      DifferenceImage& out) const {
  const RowKernels& kernels = row_kernels();
  PlaneWeights weights = weights_;
  if (!rows.shows_slide)
    for (float& w : weights.colour) w = -w;
  const int samples = 3 * out.width;
  const auto row = static_cast<std::size_t>(samples);
  scratch.rows.resize(10 * row);
  const auto scratch_row = [&](int i) { return scratch.rows.data() + row * static_cast<std::size_t>(i); };
  // The three lines about the current one, each in the place that the one three lines above it had.
  const auto fields_at = [&](int line) {
    const int place = std::clamp(line, 0, out.lines - 1) % 3;
    return FieldRows{scratch_row(2 * place), scratch_row(2 * place + 1)};
  };
  scratch.shifted.resize(3 * row);
  scratch.motion.resize(static_cast<std::size_t>(out.width));
  const float own_share = -0.5F * static_cast<float>(rows.sign());
  const auto read = [&](int line) {
    if (line < 0 || line >= out.lines) return;
    std::array<const std::uint8_t*, 3> read_rows{rows.own.row(line), rows.other_above(line),
                                                 rows.other_below(line)};
    if (out.motion.line_moves(line)) {
      out.motion.of_columns(line, out.width, scratch.motion.data());
      for (std::size_t i = 0; i < read_rows.size(); ++i) {
        std::uint8_t* shifted = scratch.shifted.data() + i * row;
        shift_row(read_rows[i], scratch.motion.data(), i == 0 ? own_share : -own_share, out.width, shifted);
        read_rows[i] = shifted;
      }
    }
    const FieldRows fields = fields_at(line);
    kernels.combine_fields(read_rows[0], read_rows[1], read_rows[2], samples, fields);
    for_steps(out.steps, line, [&](int first, int last, std::uint8_t sides) {
      if (sides == (LineSteps::kAbove | LineSteps::kBelow)) return;  // then neither row is better
      const std::uint8_t* other = read_rows[sides == LineSteps::kBelow ? 1 : 2];
      kernels.combine_fields(read_rows[0] + first, other + first, other + first, last - first,
                             {fields.difference + first, fields.sum + first});
    });
  };
  std::int16_t* across = scratch_row(6);
  const FieldRows smooth{scratch_row(7), scratch_row(8)};
  std::int16_t* alone = scratch_row(9);
  read(begin - 1);
  read(begin);
  for (int line = begin; line < end; ++line) {
    read(line + 1);
    const FieldRows above = fields_at(line - 1);
    const FieldRows here = fields_at(line);
    const FieldRows below = fields_at(line + 1);
    // A boundary that leans keeps its place, since the kernel is symmetric; where brightness changes, see
    // capture/reconstruct/leaning.h.
    for (const auto plane : {&FieldRows::difference, &FieldRows::sum}) {
      kernels.low_pass(above.*plane, here.*plane, below.*plane, samples, across, smooth.*plane);
      if (!out.steps.beside(line)) continue;
      kernels.low_pass(here.*plane, here.*plane, here.*plane, samples, across, alone);
      for_steps(out.steps, line, [&](int first, int last, std::uint8_t) {
        std::copy(alone + first, alone + last, smooth.*plane + first);
      });
    }
    const auto at = static_cast<std::size_t>(line);
    kernels.to_planes(
        smooth, out.width, weights,
        {out.values.data() + row * at, out.white.data() + static_cast<std::size_t>(out.width) * at});
  }
}

void Differencer::difference(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out) {
  out.motion.moves.clear();
  out.steps.has_below.clear();
  difference_of_all(rows, pool, out);
}

void Differencer::aligned_difference(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out) {
  motion_finder_.find(rows.slide(), rows.complement(), pool, out.motion);
  step_finder_.find(rows, pool, out.steps);
  difference_of_all(rows, pool, out);
}

void Differencer::difference_of_all(const DetectionLines& rows, WorkerPool& pool, DifferenceImage& out) {
  out.width = rows.own.width;
  out.lines = rows.own.height;
  const std::size_t pixels = static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.lines);
  out.values.resize(3 * pixels);
  out.white.resize(pixels);
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  pool.for_ranges(out.lines, [&](int begin, int end, int worker) {
    difference_of_lines(rows, begin, end, scratch_[static_cast<std::size_t>(worker)], out);
  });
  out.noise = estimate_noise(out);
}

float Differencer::largest(const DetectionLines& rows, WorkerPool& pool) {
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  for (Scratch& s : scratch_) s.largest = 0;
  for (const View8& field : {rows.slide(), rows.complement()}) {
    pool.for_ranges(field.height, [&](int begin, int end, int worker) {
      float& largest = scratch_[static_cast<std::size_t>(worker)].largest;
      for (int line = begin; line < end; ++line)
        largest = std::max(largest, largest_of_row(field.row(line), field.width, matrix_));
    });
  }
  float largest = 0;
  for (const Scratch& s : scratch_) largest = std::max(largest, s.largest);
  return largest;
}

}  // namespace relievo
