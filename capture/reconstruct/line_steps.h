// SPDX-License-Identifier: Apache-2.0
// Where a line of the picture and the next one show different surfaces: beside the top and the bottom of what
// stands before something else. The projector's light tells, since other stripes lie there. A mean over both
// lines shows neither.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/rows.h"

namespace relievo {

/// Of a frame, by lines and blocks of columns.
struct LineSteps {
  static constexpr int kBlock_px = RowKernels::kPairBlock_px;
  static constexpr std::uint8_t kAbove = 1, kBelow = 2;

  int blocks = 0;                       // of a line; columns behind the last whole one have no step
  std::vector<std::uint8_t> below;      // [line][block]: 1 where the line below is another surface
  std::vector<std::uint8_t> has_below;  // [line]: anywhere

  bool beside(int line) const {
    return !has_below.empty() && (has_below[static_cast<std::size_t>(line)] != 0 ||
                                  (line > 0 && has_below[static_cast<std::size_t>(line) - 1] != 0));
  }
  /// kAbove, kBelow, both or 0.
  std::uint8_t of_block(int line, int block) const {
    const std::size_t at =
        static_cast<std::size_t>(line) * static_cast<std::size_t>(blocks) + static_cast<std::size_t>(block);
    const bool above = line > 0 && below[at - static_cast<std::size_t>(blocks)] != 0;
    return static_cast<std::uint8_t>((above ? kAbove : 0) | (below[at] != 0 ? kBelow : 0));
  }
  std::uint8_t at(int line, int x) const {
    return beside(line) && x / kBlock_px < blocks ? of_block(line, x / kBlock_px) : std::uint8_t{0};
  }
};

/// Keeps its scratch memory from frame to frame. One thread.
class LineStepFinder {
 public:
  /// `out` is overwritten; its memory is reused.
  void find(const DetectionLines& rows, WorkerPool& pool, LineSteps& out);

 private:
  std::vector<std::vector<PairProducts>> products_;  // each worker's, of a line
  std::vector<std::uint8_t> unlike_;  // [line + 1][block]: how unlike the next line is, 0: it is alike
};

}  // namespace relievo
