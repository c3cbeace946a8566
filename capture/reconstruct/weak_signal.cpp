// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/weak_signal.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace relievo {
namespace {

constexpr int kWidth = DifferenceImage::kCellWidth;
constexpr int kLines = DifferenceImage::kCellLines;

constexpr int kBlock = 4;  // pixels and lines whose mean shows the signal
static_assert(kWidth % kBlock == 0 && kLines % kBlock == 0);
// What the low-pass [1 2 1] both ways leaves of a value's variance in a block's mean: (52 / 256 / 0.375)^2.
constexpr float kBlockVariance = 0.2934F;
constexpr float kSeen = 2.5F;   // times the noise's mean square: there is a signal
constexpr float kStrong = 7.F;  // standard deviations of a value: a pixel shows it by itself

constexpr int kReach = 3;  // pixels and lines to each side that are averaged over
constexpr std::array<float, kReach + 1> kTaps{4.F / 16, 3.F / 16, 2.F / 16, 1.F / 16};
constexpr std::array<float, kReach + 1> kFadingTaps{2.F / 4, 1.F / 4, 0, 0};  // of lines
// Standard deviation that the mean leaves, of a value's that the low-pass [1 2 1] has been over, whose
// variance becomes (646 / 4096) / 0.375 either way; over fewer lines (70 / 256) / 0.375.
constexpr float kNoiseLeft = 0.4206F;
constexpr float kFadingNoiseLeft = 0.5541F;

int first_line(int cell_row) {
  return cell_row * kLines;
}

bool averaged(Signal signal) {
  return signal == Signal::kWeak || signal == Signal::kFading;
}

}  // namespace

void WeakSignal::measure(int cell_row, Scratch& scratch, DifferenceImage& image) {
  const int width = image.width;
  const float floor = std::max(image.noise, 0.25F);
  const float seen = kSeen * kBlockVariance * floor * floor;
  const float strong = kStrong * kStrong * floor * floor;
  Signal* signal =
      image.signal.data() + static_cast<std::size_t>(cell_row) * static_cast<std::size_t>(image.cells);
  scratch.sums.resize(3 * static_cast<std::size_t>(width));
  float* sums = scratch.sums.data();
  const int last = std::min(image.lines, first_line(cell_row) + kLines);
  scratch.squares.assign(static_cast<std::size_t>(image.cells), 0.F);
  int block_rows = 0;
  for (int line = first_line(cell_row); line + kBlock <= last; line += kBlock, ++block_rows) {
    const float* a = image.line(line);
    const float* b = image.line(line + 1);
    const float* c = image.line(line + 2);
    const float* d = image.line(line + 3);
    for (int i = 0; i < 3 * width; ++i) sums[i] = a[i] + b[i] + c[i] + d[i];
    for (int channel = 0; channel < 3; ++channel) {
      const float* row = sums + channel * width;
      for (int x = 0; x + kBlock <= width; x += kBlock) {
        const float mean = (row[x] + row[x + 1] + row[x + 2] + row[x + 3]) * (1.F / (kBlock * kBlock));
        scratch.squares[static_cast<std::size_t>(x / kWidth)] += mean * mean;
      }
    }
  }
  for (int cell = 0; cell < image.cells; ++cell) {
    const int blocks = 3 * block_rows * ((std::min(width, (cell + 1) * kWidth) - cell * kWidth) / kBlock);
    const float square =
        blocks == 0 ? 0 : scratch.squares[static_cast<std::size_t>(cell)] / static_cast<float>(blocks);
    signal[cell] = square > strong ? Signal::kStrong : square > seen ? Signal::kWeak : Signal::kNone;
  }
}

/// Weak cells that have others above or below. There the brighter lines would hide what the others show.
void WeakSignal::mark_fading(int rows, DifferenceImage& image) {
  const auto at = [&](int r, int c) -> Signal& {
    return image.signal[static_cast<std::size_t>(std::clamp(r, 0, rows - 1) * image.cells + c)];
  };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < image.cells; ++c)
      if (at(r, c) == Signal::kWeak && !(averaged(at(r - 1, c)) && averaged(at(r + 1, c))))
        at(r, c) = Signal::kFading;
}

void WeakSignal::average_cell(const DifferenceImage& image, int cell_row, int cell, Scratch& scratch) {
  const int first = cell * kWidth;
  const int count = std::min(kWidth, image.width - first);
  const bool fading = image.signal_at(first_line(cell_row), first) == Signal::kFading;
  const std::array<float, kReach + 1>& across = fading ? kFadingTaps : kTaps;
  std::array<float, kWidth + 2 * kReach> down{};
  for (int line = first_line(cell_row); line < std::min(image.lines, first_line(cell_row) + kLines); ++line) {
    for (int channel = 0; channel < 3; ++channel) {
      const auto row = [&](int l) {
        return image.line(std::clamp(l, 0, image.lines - 1)) + channel * image.width;
      };
      for (int i = 0; i < count + 2 * kReach; ++i) {
        const int x = std::clamp(first - kReach + i, 0, image.width - 1);
        float sum = across[0] * row(line)[x];
        for (int k = 1; k <= kReach; ++k)
          sum += across[static_cast<std::size_t>(k)] * (row(line - k)[x] + row(line + k)[x]);
        down[static_cast<std::size_t>(i)] = sum;
      }
      for (int i = 0; i < count; ++i) {
        const float* p = down.data() + i + kReach;
        float sum = kTaps[0] * p[0];
        for (int k = 1; k <= kReach; ++k) sum += kTaps[static_cast<std::size_t>(k)] * (p[k] + p[-k]);
        scratch.averaged.push_back(sum);
      }
    }
  }
}

void WeakSignal::average(WorkerPool& pool, DifferenceImage& image) {
  const int rows = (image.lines + kLines - 1) / kLines;
  image.cells = (image.width + kWidth - 1) / kWidth;
  image.signal.resize(static_cast<std::size_t>(image.cells) * static_cast<std::size_t>(rows));
  image.weak_noise = kNoiseLeft * image.noise;
  image.fading_noise = kFadingNoiseLeft * image.noise;
  scratch_.resize(static_cast<std::size_t>(pool.workers()));
  const auto weak = [&](int cell_row, int cell) {
    return averaged(image.signal[static_cast<std::size_t>(cell_row * image.cells + cell)]);
  };
  pool.for_ranges(rows, [&](int begin, int end, int worker) {
    for (int r = begin; r < end; ++r) measure(r, scratch_[static_cast<std::size_t>(worker)], image);
  });
  mark_fading(rows, image);
  pool.for_ranges(rows, [&](int begin, int end, int worker) {
    Scratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    scratch.averaged.reserve(3 * static_cast<std::size_t>(image.width) *
                             static_cast<std::size_t>((end - begin) * kLines));
    scratch.averaged.clear();
    for (int r = begin; r < end; ++r)
      for (int c = 0; c < image.cells; ++c)
        if (weak(r, c)) average_cell(image, r, c, scratch);
  });
  // Only now, since cells are averaged over their neighbours' values as they were. The ranges are those of
  // above.
  pool.for_ranges(rows, [&](int begin, int end, int worker) {
    const float* from = scratch_[static_cast<std::size_t>(worker)].averaged.data();
    for (int r = begin; r < end; ++r) {
      for (int c = 0; c < image.cells; ++c) {
        if (!weak(r, c)) continue;
        const int count = std::min(kWidth, image.width - c * kWidth);
        for (int line = first_line(r); line < std::min(image.lines, first_line(r) + kLines); ++line) {
          for (int channel = 0; channel < 3; ++channel, from += count) {
            float* to = image.values.data() +
                        (static_cast<std::size_t>(line) * 3 + static_cast<std::size_t>(channel)) *
                            static_cast<std::size_t>(image.width) +
                        c * kWidth;
            std::copy_n(from, count, to);
          }
        }
      }
    }
  });
}

}  // namespace relievo
