// SPDX-License-Identifier: Apache-2.0
// The difference image (field_difference.h) as the quick decoder keeps it: whole numbers of 16 bits, and of
// each pixel a byte that says which primary it shows and whether that is sure. Fields are not aligned.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/quick_rows.h"

namespace relievo {

/// Lines as of DifferenceImage. Numbers are grey levels times QuickKernels::kScale. Rows can be read for
/// kPadding columns behind their last.
struct QuickImage {
  static constexpr int kPadding = 16;

  int width = 0;
  int lines = 0;
  int stride = 0;                    // of a row, with what is behind it
  std::vector<std::int16_t> planes;  // [line][red, green, blue][stride]
  std::vector<std::int16_t> luma;    // [line][stride]: of the fields' sum
  std::vector<std::uint8_t> codes;   // [line][stride]: as QuickKernels::codes makes them
  float noise = 0;                   // standard deviation of a value of planes

  /// Red; green and blue lie `stride` and twice that behind.
  const std::int16_t* line(int l) const { return planes.data() + 3 * at(l); }
  QuickRow row(int l) const { return {line(l), line(l) + stride, line(l) + 2 * stride}; }
  const std::int16_t* luma_line(int l) const { return luma.data() + at(l); }
  const std::uint8_t* code_line(int l) const { return codes.data() + at(l); }

  /// What a value must exceed for its sign to be believed.
  float doubt() const { return 2 * noise + 0.5F * QuickKernels::kScale; }

 private:
  std::size_t at(int l) const { return static_cast<std::size_t>(l) * static_cast<std::size_t>(stride); }
};

/// A colour matrix as the quick decoder takes it: in proportion, so small that 16 bits hold it. That of a
/// camera that sees little has entries above four; what a difference shows, and where, stays the same.
std::array<double, 9> quick_matrix(std::array<double, 9> colour_matrix);

/// Keeps its scratch memory from frame to frame. One thread.
class QuickDifferencer {
 public:
  explicit QuickDifferencer(const std::array<double, 9>& colour_matrix);

  /// `out` is overwritten; its memory is reused. Calls visit(begin, end, worker) for lines as soon as they
  /// are there, and the noise with them: that of the frame before, but for the first one's.
  template <typename Visit>
  void difference(const DetectionLines& lines, WorkerPool& pool, QuickImage& out, const Visit& visit) {
    start(lines, pool, out);
    pool.for_ranges(out.lines, [&](int begin, int end, int worker) {
      for (int first = begin; first < end; first += kBlock) {
        const int last = first + kBlock < end ? first + kBlock : end;
        difference_of_lines(lines, first, last, scratch_[static_cast<std::size_t>(worker)], out);
        visit(first, last, worker);
      }
    });
    noise_ = estimate_noise(out);
  }

 private:
  static constexpr int kBlock = 16;  // lines that stay in the processor's own memory

  void start(const DetectionLines& lines, WorkerPool& pool, QuickImage& out);
  static float estimate_noise(const QuickImage& image);
  void difference_of_lines(const DetectionLines& lines, int begin, int end,
                           std::vector<std::int16_t>& scratch, QuickImage& out) const;

  QuickWeights weights_;
  float noise_ = -1;                                // of the last frame; below 0: there was none
  std::vector<std::vector<std::int16_t>> scratch_;  // rows, one set a worker
};

/// As that of DifferenceImage (sequence.h).
bool same_slide(const QuickImage& a, const QuickImage& b);

}  // namespace relievo
