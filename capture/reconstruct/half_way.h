// SPDX-License-Identifier: Apache-2.0
// Where each boundary was on each line of the frame before, to place boundaries at an instant between two
// frames.
#pragma once

#include <cstdint>
#include <vector>

#include "capture/reconstruct/slide_decoder.h"

namespace relievo {

/// Empty until keep(). One thread.
class LastColumns {
 public:
  /// What keep() was given last.
  std::int64_t time_ns() const { return time_ns_; }

  /// `out` becomes the boundaries that both frames have on a line, half way between their columns. False,
  /// and `out` empty, where nothing was kept, or more than `longest_ns` before.
  bool half_way(const std::vector<DecodedBoundary>& now, std::int64_t time_ns, std::int64_t longest_ns,
                std::vector<DecodedBoundary>& out) const;

  /// Replaces what was kept.
  void keep(const std::vector<DecodedBoundary>& boundaries, std::int64_t time_ns);

 private:
  std::int64_t time_ns_ = 0;
  std::size_t width_ = 0;       // boundaries a line
  std::vector<float> columns_;  // [line][boundary], NaN where there is none
};

}  // namespace relievo
