// SPDX-License-Identifier: Apache-2.0
// Boundaries that a line shows twice: on what is in front, and beside it on what is behind, where another row
// of the projector lights that. Whoever decodes a line has one place for a boundary; the edge of the other is
// told by what it goes on from on the lines above and below or beside it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/decoded_grid.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/margin_grid.h"
#include "capture/reconstruct/moving_places.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Of a boundary that its line has elsewhere, too.
struct SecondPlace {
  std::uint16_t boundary, line;
  float column_px, sigma_px;
};

/// A decoded frame.
struct DecodedEdges {
  const EdgeImage& edges;
  const SequenceResult& result;
  const SequenceDecoder& sequence;
  const SequenceContext& context;
  const MovingPlaces& moving;
  const DecodedGrid& first;  // its boundaries
};

/// Keeps its memory from frame to frame. One thread; the result is the same for any pool.
class SecondPlaces {
 public:
  /// Forgets what was found.
  void clear();
  /// After clear(): edges that hold still and are no boundary of `frame`, but clearly show the colours of
  /// one, where such a boundary's neighbours go on to. None on the first line. Returns how many.
  std::size_t find(const DecodedEdges& frame, WorkerPool& pool);
  /// By line, then boundary.
  const std::vector<SecondPlace>& found() const { return found_; }

 private:
  struct Candidate {
    int line, boundary;
    std::uint32_t edge;
  };
  using Candidates = std::vector<Candidate>;
  void find_candidates(const DecodedEdges& frame, int line, Candidates& out) const;
  float foretold_px(const DecodedEdges& frame, const Candidate& candidate) const;
  float near(const DecodedGrid& first, int line, int boundary, float column_px) const;

  std::array<std::vector<std::int16_t>, 64> by_colours_;  // boundaries, [left * 8 + right]
  std::vector<Candidates> of_lines_;                      // one a worker,
  Candidates candidates_;                                 // and all of them
  std::vector<std::uint8_t> taken_;                       // one an edge
  MarginGrid<float, 2> second_;                           // columns
  std::vector<SecondPlace> found_;
};

/// What two frames in a row have at one place of the grid, half way between them.
void second_half_way(const std::vector<SecondPlace>& before, const std::vector<SecondPlace>& now,
                     std::vector<SecondPlace>& out);

}  // namespace relievo
