// SPDX-License-Identifier: Apache-2.0
// The difference image (field_difference.h) as the quick decoder keeps it: whole numbers of 16 bits, a
// pixel's channels beside each other, so that what is asked about a place is read at once. Fields are not
// aligned.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/quick_rows.h"
#include "capture/source/field_source.h"

namespace relievo {

/// Lines as of DifferenceImage. Numbers are grey levels times QuickKernels::kScale.
struct QuadImage {
  int width = 0;
  int lines = 0;
  std::vector<std::int16_t> quads;  // [line][width][red, green, blue, 0]
  std::vector<std::int16_t> luma;   // [line][width]: of the fields' sum
  float noise = 0;                  // standard deviation of a value of quads

  const std::int16_t* line(int l) const {
    return quads.data() + static_cast<std::size_t>(l) * 4 * static_cast<std::size_t>(width);
  }
  const std::int16_t* luma_line(int l) const {
    return luma.data() + static_cast<std::size_t>(l) * static_cast<std::size_t>(width);
  }
};

/// Keeps its scratch memory from frame to frame. One thread.
class QuickDifferencer {
 public:
  explicit QuickDifferencer(const std::array<double, 9>& colour_matrix);

  /// `out` is overwritten; its memory is reused. Calls visit(begin, end, worker) for lines as soon as they
  /// are there, and the noise with them: that of the frame before, but for the first one's.
  template <typename Visit>
  void difference(const CapturedFrame& frame, WorkerPool& pool, QuadImage& out, const Visit& visit) {
    start(frame, pool, out);
    pool.for_ranges(out.lines, [&](int begin, int end, int worker) {
      for (int first = begin; first < end; first += kBlock) {
        const int last = first + kBlock < end ? first + kBlock : end;
        difference_of_lines(frame, first, last, scratch_[static_cast<std::size_t>(worker)], out);
        visit(first, last, worker);
      }
    });
    noise_ = estimate_noise(out);
  }

 private:
  static constexpr int kBlock = 16;  // lines that stay in the processor's own memory

  void start(const CapturedFrame& frame, WorkerPool& pool, QuadImage& out);
  static float estimate_noise(const QuadImage& image);
  void difference_of_lines(const CapturedFrame& frame, int begin, int end, std::vector<std::int16_t>& scratch,
                           QuadImage& out) const;

  QuadWeights weights_;
  float noise_ = -1;                                // of the last frame; below 0: there was none
  std::vector<std::vector<std::int16_t>> scratch_;  // rows, one set a worker
};

/// As that of DifferenceImage (sequence.h).
bool same_slide(const QuadImage& a, const QuadImage& b);

}  // namespace relievo
