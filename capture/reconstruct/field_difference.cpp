// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/field_difference.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace relievo {
namespace {

/// Low-pass along the line ([1 2 1] / 4) and the colour matrix (Eq. 3) on one RGB row, into three planes of
/// `width`, and the luma (Rec. 601) of the captured colours into a fourth. Returns the largest calibrated
/// value (5.2: the normalisation range).
float calibrate_row(const std::uint8_t* rgb, int width, const std::array<float, 9>& m, float* out) {
  float* red = out;
  float* green = out + width;
  float* blue = out + 2 * width;
  float* luma = out + 3 * width;
  const auto store = [&](int x, float r, float g, float b) {
    luma[x] = 0.299F * r + 0.587F * g + 0.114F * b;
    red[x] = m[0] * r + m[1] * g + m[2] * b;
    green[x] = m[3] * r + m[4] * g + m[5] * b;
    blue[x] = m[6] * r + m[7] * g + m[8] * b;
  };
  for (int x = 1; x + 1 < width; ++x) {
    const std::uint8_t* p = rgb + 3 * x;
    const auto low_pass = [&](int c) { return 0.25F * static_cast<float>(p[c - 3] + 2 * p[c] + p[c + 3]); };
    store(x, low_pass(0), low_pass(1), low_pass(2));
  }
  const auto copy = [&](int x) { store(x, rgb[3 * x], rgb[3 * x + 1], rgb[3 * x + 2]); };
  copy(0);
  copy(width - 1);
  float largest = 0;
  for (int i = 0; i < 3 * width; ++i) largest = std::max(largest, out[i]);
  return largest;
}

/// Standard deviation of the values, from second differences over lines so far apart that the low-pass leaves
/// them independent. Stripes run across lines, so most places look the same there; the 30 % quantile looks
/// past those that do not.
float estimate_noise(const DifferenceImage& image) {
  constexpr int kApart = 3;
  constexpr int kBins = 1024;
  constexpr float kPerBin = 1.F / 16;
  constexpr float kQuantile30 = 0.3853F;  // of |N(0, 1)|
  constexpr float kGain = 2.4495F;        // of [1 -2 1], the square root of 6
  std::array<std::uint32_t, kBins> histogram{};
  std::uint32_t total = 0;
  for (int line = 0; line + 2 * kApart < image.lines; line += 7) {
    const float* above = image.line(line);
    const float* here = image.line(line + kApart);
    const float* below = image.line(line + 2 * kApart);
    for (int i = 0; i < 3 * image.width; i += 5) {
      const float second = std::fabs(above[i] - 2 * here[i] + below[i]);
      ++histogram[static_cast<std::size_t>(std::min<float>(kBins - 1, second / kPerBin))];
      ++total;
    }
  }
  std::uint32_t seen = 0;
  for (int i = 0; i < kBins; ++i) {
    seen += histogram[static_cast<std::size_t>(i)];
    if (seen * 10 >= total * 3 && total > 0)
      return (static_cast<float>(i) + 0.5F) * kPerBin / (kQuantile30 * kGain);
  }
  return 0;
}

}  // namespace

Differencer::Differencer(const std::array<double, 9>& colour_matrix) {
  for (std::size_t i = 0; i < 9; ++i) matrix_[i] = static_cast<float>(colour_matrix[i]);
}

void Differencer::raw_difference(const CapturedFrame& frame, WorkerPool& pool, DifferenceImage& image) {
  const View8 slide = frame.slide_field();
  const View8 complement = frame.complement_field();
  const int width = image.width;
  const std::size_t colours = static_cast<std::size_t>(width) * 3;
  const std::size_t plane = static_cast<std::size_t>(width) * 4;
  raw_.resize(plane * static_cast<std::size_t>(image.lines));
  scratch_.resize(static_cast<std::size_t>(pool.threads()));
  for (Scratch& s : scratch_) s.largest = 0;
  pool.for_ranges(image.lines, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    scratch.rows.resize(plane * 3);
    float* slide_row = scratch.rows.data();
    float* above = slide_row + plane;  // complement's row above the slide's
    float* below = slide_row + 2 * plane;
    const auto calibrate = [&](const View8& view, int line, float* out) {
      const std::uint8_t* row = view.row(std::clamp(line, 0, view.height - 1));
      scratch.largest = std::max(scratch.largest, calibrate_row(row, width, matrix_, out));
    };
    const bool interlaced = frame.scan == Scan::kInterlaced;
    if (interlaced) calibrate(complement, std::max(0, begin - 1), above);
    for (int line = begin; line < end; ++line) {
      calibrate(slide, line, slide_row);
      calibrate(complement, line, below);
      float* out = raw_.data() + plane * static_cast<std::size_t>(line);
      if (interlaced) {
        // The complement's rows lie half a line off the slide's: their mean is what it shows at the slide's
        // row.
        for (std::size_t i = 0; i < colours; ++i) out[i] = slide_row[i] - 0.5F * (above[i] + below[i]);
        for (std::size_t i = colours; i < plane; ++i) out[i] = slide_row[i] + 0.5F * (above[i] + below[i]);
        std::swap(above, below);
      } else {
        for (std::size_t i = 0; i < colours; ++i) out[i] = slide_row[i] - below[i];
        for (std::size_t i = colours; i < plane; ++i) out[i] = slide_row[i] + below[i];
      }
    }
  });
}

void Differencer::difference(const CapturedFrame& frame, WorkerPool& pool, DifferenceImage& out) {
  const View8 slide = frame.slide_field();
  out.width = slide.width;
  out.lines = slide.height;
  raw_difference(frame, pool, out);
  const std::size_t colours = static_cast<std::size_t>(out.width) * 3;
  const std::size_t white = static_cast<std::size_t>(out.width);
  const std::size_t plane = colours + white;
  out.values.resize(colours * static_cast<std::size_t>(out.lines));
  out.white.resize(white * static_cast<std::size_t>(out.lines));
  pool.for_ranges(out.lines, [&](int begin, int end, int) {
    for (int line = begin; line < end; ++line) {
      const auto row = [&](int l) {
        return raw_.data() + plane * static_cast<std::size_t>(std::clamp(l, 0, out.lines - 1));
      };
      // The low-pass across lines; a boundary that leans keeps its place, since the kernel is symmetric.
      const float* above = row(line - 1);
      const float* here = row(line);
      const float* below = row(line + 1);
      const auto smooth = [&](float* to, std::size_t from, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i)
          to[i] = 0.25F * (above[from + i] + below[from + i]) + 0.5F * here[from + i];
      };
      smooth(out.values.data() + colours * static_cast<std::size_t>(line), 0, colours);
      smooth(out.white.data() + white * static_cast<std::size_t>(line), colours, white);
    }
  });
  out.largest = 0;
  for (const Scratch& s : scratch_) out.largest = std::max(out.largest, s.largest);
  out.noise = estimate_noise(out);
}

}  // namespace relievo
