// SPDX-License-Identifier: Apache-2.0
// Which vertices and triangles of a grid hang together: a bit for each place of a line, runs of places that
// triangles join, and pieces of runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"

namespace relievo {

/// What is known of a line's places, each a row of bits, place 0 first.
enum class PlaceBits {
  kVertex,                 // there is one; after keep(): that stays
  kStart,                  // no triangle joins it to the vertex before it on the line
  kUp,                     // something joins it to the one above it
  kFirst,                  // the cell to the lower right has this triangle; after keep(): that stays
  kSecond,                 // and that one
  kTurned,                 // where the cell has them: see surface_cells.h
  kOfLines,                // so many rows are kept for each line
  kFirstJoins = kOfLines,  // those below only while a line is read
  kSecondJoins,
  kSureDown,
  kAll,
};

/// Keeps its memory from frame to frame. Different lines may be read by different threads; else one thread.
class SurfacePieces {
 public:
  using Word = std::uint64_t;

  void reset(int width, int lines);

  /// What a line's cells say (surface_cells.h), as bits.
  struct Cells {
    std::vector<Word> words;  // of each PlaceBits
  };
  void read_cells(const std::uint8_t* cells, Cells& out) const;
  /// Of a line, from the cells above and below it.
  void read_line(int line, const Cells& above, const Cells& below);

  /// Once all lines are read: takes away what is in pieces smaller than `least_component` (SurfaceOptions),
  /// and counts what stays. Returns how many vertices went.
  std::size_t keep(int least_component, WorkerPool* pool);
  /// What stays on the lines before this one, `lines` for all.
  std::uint32_t vertices_before(int line) const { return vertices_before_[static_cast<std::size_t>(line)]; }
  std::uint32_t triangles_before(int line) const { return triangles_before_[static_cast<std::size_t>(line)]; }

  std::size_t words() const { return words_; }
  const Word* bits(int line, PlaceBits which) const { return bits_.data() + first_of(line, which); }

 private:
  std::size_t first_of(int line, PlaceBits which) const {
    return (static_cast<std::size_t>(line) * static_cast<std::size_t>(PlaceBits::kOfLines) +
            static_cast<std::size_t>(which)) *
           words_;
  }
  Word* bits_of(int line, PlaceBits which) { return bits_.data() + first_of(line, which); }
  void find_runs();
  void join_runs();
  void join(std::int32_t a, std::int32_t b);
  std::int32_t root(std::int32_t run);
  std::size_t keep_line(int line);

  int lines_ = 0;
  std::size_t words_ = 0;  // a row
  std::vector<Word> bits_;
  std::vector<std::int32_t> runs_before_;  // of each line
  std::vector<std::int32_t> parent_;       // union-find over runs
  std::vector<std::int32_t> size_;         // of a root's piece
  std::vector<std::uint8_t> kept_;         // of a run: its piece is large enough
  bool all_kept_ = true;
  std::vector<std::uint32_t> vertices_before_, triangles_before_;
};

}  // namespace relievo
