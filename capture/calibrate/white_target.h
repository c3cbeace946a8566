// SPDX-License-Identifier: Apache-2.0
// Finds the white target of a colour calibration.
#pragma once

#include <optional>
#include <vector>

#include "capture/calibrate/colour.h"

namespace relievo {

struct WhiteTarget {
  std::vector<std::uint8_t> mask;  // 1 inside, of the pictures' size
  Roi box;
  std::size_t pixels = 0;
};

/// The largest connected region that the projector's white lights at least half as much as the brightest
/// parts, without its rim, where it mixes with what is around it; or what lies in `roi`. Captures hold black
/// and white, of one size. Fails where the region is too small to average over.
Result<WhiteTarget> find_white_target(const std::vector<ColourCapture>& captures,
                                      const std::optional<Roi>& roi);

}  // namespace relievo
