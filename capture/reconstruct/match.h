// SPDX-License-Identifier: Apache-2.0
// Which projected boundary each detected one is, from the colours of two frames in a row (paper 5.3).
#pragma once

#include <cstdint>
#include <vector>

#include "base/pattern.h"
#include "capture/reconstruct/detect.h"

namespace relievo {

/// Boundary index by the colour transitions under the slides: the decoding table of paper 3.2, laid out for
/// the matcher. Constant time.
class TransitionTable {
 public:
  /// `pattern` must be valid (check_pattern) and have one or two slides.
  explicit TransitionTable(const Pattern& pattern);

  /// Boundary whose colours go first_left -> first_right under slide 1 and second_left -> second_right under
  /// slide 2; -1 where no boundary of the pattern does. With one slide the second transition is ignored.
  int boundary(Primary first_left, Primary first_right, Primary second_left, Primary second_right) const {
    return table_[index(first_left, first_right) * 64 +
                  (slides_ == 2 ? index(second_left, second_right) : 0)];
  }
  int slides() const { return slides_; }

 private:
  static std::size_t index(Primary left, Primary right) { return static_cast<std::size_t>(left * 8 + right); }

  int slides_;
  std::vector<std::int16_t> table_;  // [64 transitions of slide 1][64 of slide 2]
};

/// Which slide the newer of two frames shows.
enum class SlideOrder { kNewerIsFirst, kNewerIsSecond };

struct Match {
  std::vector<std::int16_t>
      boundary;  // one a detected boundary of the newer frame: its index in the pattern, or -1
  std::size_t valid = 0;
};

/// For each boundary P of `newer` the nearest Q of `older` in a 7 x 7 neighbourhood that makes a valid code
/// with it. `out` is overwritten.
void match_boundaries(const Detection& newer, const Detection& older, SlideOrder order,
                      const TransitionTable& table, Match& out);

/// With one slide a boundary's own colours are its code. `out` is overwritten.
void decode_single_slide(const Detection& frame, const TransitionTable& table, Match& out);

}  // namespace relievo
