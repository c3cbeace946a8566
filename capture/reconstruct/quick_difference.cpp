// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/quick_difference.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "capture/reconstruct/place_rules.h"
#include "capture/reconstruct/rows.h"

namespace relievo {
namespace {

constexpr double kUnit = 8192;  // of QuickWeights
constexpr double kMostWeight = 32767;

std::int16_t weight_of(double w) {
  return static_cast<std::int16_t>(std::lround(w * kUnit));
}

}  // namespace

std::array<double, 9> quick_matrix(std::array<double, 9> colour_matrix) {
  double most = kMostWeight / kUnit;
  for (const double m : colour_matrix) most = std::max(most, std::fabs(m));
  for (double& m : colour_matrix) m *= kMostWeight / kUnit / most;
  return colour_matrix;
}

QuickDifferencer::QuickDifferencer(const std::array<double, 9>& colour_matrix) {
  const std::array<double, 9> matrix = quick_matrix(colour_matrix);
  for (std::size_t i = 0; i < 9; ++i) weights_.colour[i] = weight_of(matrix[i]);
  weights_.luma = {weight_of(0.299), weight_of(0.587), weight_of(0.114)};  // Rec. 601
}

void QuickDifferencer::difference_of_lines(const DetectionLines& lines, int begin, int end,
                                           std::vector<std::int16_t>& scratch, QuickImage& out) const {
  const RowKernels& rows = row_kernels();
  const QuickKernels& kernels = quick_kernels();
  if (lines.other.empty()) {  // an interlaced picture of one row has no complement
    std::fill(out.planes.begin(), out.planes.end(), std::int16_t{0});
    std::fill(out.luma.begin(), out.luma.end(), std::int16_t{0});
    std::fill(out.codes.begin(), out.codes.end(), std::uint8_t{0});
    return;
  }
  QuickWeights weights = weights_;
  if (!lines.shows_slide)
    for (std::int16_t& w : weights.colour) w = static_cast<std::int16_t>(-w);
  const int samples = 3 * out.width;
  const auto row = static_cast<std::size_t>(samples);
  scratch.resize(9 * row);
  const auto scratch_row = [&](int i) { return scratch.data() + row * static_cast<std::size_t>(i); };
  // The three lines about the current one, each in the place that the one three lines above it had.
  const auto fields_at = [&](int line) {
    const int place = std::clamp(line, 0, out.lines - 1) % 3;
    return FieldRows{scratch_row(2 * place), scratch_row(2 * place + 1)};
  };
  const auto read = [&](int line) {
    if (line < 0 || line >= out.lines) return;
    rows.combine_fields(lines.own.row(line), lines.other_above(line), lines.other_below(line), samples,
                        fields_at(line));
  };
  const auto doubt = static_cast<std::int16_t>(std::min(out.doubt(), 16383.F));
  std::int16_t* across = scratch_row(6);
  std::int16_t* difference = scratch_row(7);
  std::int16_t* sum = scratch_row(8);
  read(begin - 1);
  read(begin);
  for (int line = begin; line < end; ++line) {
    read(line + 1);
    const FieldRows above = fields_at(line - 1);
    const FieldRows here = fields_at(line);
    const FieldRows below = fields_at(line + 1);
    rows.low_pass(above.difference, here.difference, below.difference, samples, across, difference);
    rows.low_pass(above.sum, here.sum, below.sum, samples, across, sum);
    const std::size_t at = static_cast<std::size_t>(line) * static_cast<std::size_t>(out.stride);
    kernels.to_planes(difference, sum, out.width, weights, out.planes.data() + 3 * at, out.stride,
                      out.luma.data() + at);
    kernels.codes(out.row(line), out.width, doubt, out.codes.data() + at);
  }
}

float QuickDifferencer::estimate_noise(const QuickImage& image) {
  constexpr int kPerBin = QuickKernels::kScale / 4;
  return place_rules::noise_across_lines(
      image, 17, kPerBin,
      [&](const std::int16_t* above, const std::int16_t* here, const std::int16_t* below, auto& seconds) {
        for (int c = 0; c < 3; ++c) {
          for (int i = c * image.stride + c; i < c * image.stride + image.width; i += 5)
            seconds.add(static_cast<std::size_t>(std::abs(above[i] - 2 * here[i] + below[i]) / kPerBin));
        }
      });
}

void QuickDifferencer::start(const DetectionLines& lines, WorkerPool& pool, QuickImage& out) {
  out.width = lines.own.width;
  out.lines = lines.own.height;
  out.stride = (out.width + 15) / 16 * 16 + QuickImage::kPadding;
  const std::size_t places = static_cast<std::size_t>(out.stride) * static_cast<std::size_t>(out.lines);
  out.planes.resize(3 * places);
  out.luma.resize(places);
  out.codes.resize(places);
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  if (noise_ < 0) {
    out.noise = 0;
    pool.for_ranges(out.lines, [&](int begin, int end, int worker) {
      difference_of_lines(lines, begin, end, scratch_[static_cast<std::size_t>(worker)], out);
    });
    noise_ = estimate_noise(out);
  }
  out.noise = noise_;
}

bool same_slide(const QuickImage& a, const QuickImage& b) {
  constexpr int kEveryLine = 13;
  if (a.codes.size() != b.codes.size()) return false;
  std::uint32_t both = 0;
  std::uint32_t differ = 0;
  for (int line = 0; line < a.lines; line += kEveryLine) {
    const std::uint8_t* ca = a.code_line(line);
    const std::uint8_t* cb = b.code_line(line);
    for (int x = 0; x < a.width; ++x) {
      const bool clear = ca[x] & cb[x] & QuickKernels::kIsClear;
      const unsigned other = clear ? (ca[x] ^ cb[x]) & QuickKernels::kSigns : 0U;
      both += clear;
      differ += (other & 1) + (other >> 1 & 1) + (other >> 2);
    }
  }
  // Channels of two slides agree about every second time; of the same slide, but for what moved, always.
  return both > 0 && std::uint64_t{differ} * 10 < std::uint64_t{both} * 3 * 2;
}

}  // namespace relievo
