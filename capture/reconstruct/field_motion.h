// SPDX-License-Identifier: Apache-2.0
// How far stripes moved along the lines between the exposures of a frame's slide and of its complement. What
// comes nearer or goes away moves them by several pixels; then the two do not add up to white, and their
// difference shows a boundary twice or not at all. Where stripes vanish from the sum of one field and the
// other shifted against it, that shift is the motion.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/image.h"
#include "base/parallel.h"

namespace relievo {

/// Of a frame, by cells of lines and columns of the difference image.
struct FieldMotion {
  static constexpr int kCellWidth = 16;
  static constexpr int kCellLines = 8;

  int cells = 0;                    // in a row of them
  float scale = 1;                  // of distances, by the camera's width: 1 up to 640 columns
  std::vector<float> px;            // [row][cell]: from the slide's exposure to the complement's; 0: none
  std::vector<std::uint8_t> moves;  // [row]: a cell of it does; empty: nothing does anywhere

  bool line_moves(int line) const {
    return !moves.empty() && moves[static_cast<std::size_t>(line / kCellLines)] != 0;
  }
  /// At a place of the picture, without jumps but where surfaces move unlike each other.
  float at(int line, float column_px) const { return line_moves(line) ? between(line, column_px) : 0; }
  /// How far what is at a place came since the frame `before`, so many times as long ago as fields lie apart:
  /// by the mean of its motions in both frames.
  float between_frames(const FieldMotion& before, int line, float column_px, float fields) const;
  /// At each of `count` columns of a line.
  void of_columns(int line, int count, float* out) const;

  /// Most between the motions of one surface in two frames, or of the parts of it in one.
  static constexpr float kSurface_px = 2;

 private:
  float between(int line, float column_px) const;
};

/// Keeps its scratch memory from frame to frame. One thread.
class MotionFinder {
 public:
  /// `slide` and `complement` are RGB, a row a line. `out` is overwritten; its memory is reused.
  void find(View8 slide, View8 complement, WorkerPool& pool, FieldMotion& out);

 private:
  struct Scratch {
    std::vector<std::uint8_t> sum, step;  // of a line
  };
  void measure(View8 slide, View8 complement, int cell_row, Scratch& scratch);
  void residue(View8 slide, View8 complement, int cell_row, int shift_px, Scratch& scratch);
  std::uint32_t* costs(int cell_row, int shift_px);
  bool may_move(int cell_row);
  void choose(int cell_row, FieldMotion& out);

  int cells_ = 0, rows_ = 0;
  std::vector<std::uint32_t> costs_;    // [row][shift][cell]: stripes left in the sum
  std::vector<std::uint8_t> measured_;  // [row]: at all shifts
  std::vector<Scratch> scratch_;
};

}  // namespace relievo
