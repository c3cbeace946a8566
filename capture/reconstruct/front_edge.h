// SPDX-License-Identifier: Apache-2.0
// The last boundaries of a surface that ends in front of another. Where a sliver of the front's last stripe
// is all that lies between its boundary and the surface behind, that surface's colour is what is seen beside
// the boundary, which is then taken for one of the surface behind.
#pragma once

#include <array>
#include <vector>

#include "base/parallel.h"
#include "base/rig.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// One thread.
class FrontEdges {
 public:
  explicit FrontEdges(const Rig& rig);

  /// On which side of a last boundary before another surface the front is: -1 on its left, where what is
  /// nearer has less of them; 1 on its right, where the projector stands to the camera's left.
  int front() const { return front_; }

  using Colours = std::vector<std::array<Primary, 2>>;  // to the left and right of each boundary
  /// Gives such boundaries, which go on from the front and not from what is behind, to the front. `shown` and
  /// `other` are the colours under the slide that the edges were found under and under the other; `boundary`
  /// and `seen_px` of `result` change. Says how many there were.
  std::size_t correct(const EdgeImage& edges, const Colours& shown, const Colours& other, WorkerPool& pool,
                      SequenceResult& result);

 private:
  struct Decoded {
    float column_px;
    int boundary;
    std::uint32_t edge;
  };
  struct Scratch {
    std::vector<Decoded> line;
    std::size_t corrected = 0;
  };
  std::size_t correct_line(std::vector<Decoded>& line, const Colours& shown, const Colours& other) const;

  int front_;                     // see front()
  std::vector<Scratch> scratch_;  // one a worker
};

}  // namespace relievo
