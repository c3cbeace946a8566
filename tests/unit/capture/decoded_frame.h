// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

struct DecodedFrame {
  EdgeImage edges;
  SequenceResult result;
};

/// Every boundary on every line, decoded and still: edges like `like` at place(line, boundary).
template <typename Place>
DecodedFrame decoded_frame(int lines, int boundaries, const Edge& like, const Place& place) {
  DecodedFrame out;
  out.edges.lines = lines;
  out.edges.line_start.push_back(0);
  for (int line = 0; line < lines; ++line) {
    for (int b = 0; b < boundaries; ++b) {
      out.edges.edges.push_back(like);
      out.edges.edges.back().column_px = place(line, b);
      out.result.boundary.push_back(static_cast<std::int16_t>(b));
      out.result.doubted.push_back(-1);
      out.result.still.push_back(1);
    }
    out.edges.line_start.push_back(static_cast<std::uint32_t>(out.edges.edges.size()));
  }
  return out;
}

}  // namespace relievo
