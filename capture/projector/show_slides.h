// SPDX-License-Identifier: Apache-2.0
// Projects a pattern: what its scheme shows, in its order, a picture every so many refreshes
// (paper 4.1, 5.1).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "base/pattern.h"
#include "base/result.h"
#include "base/rig.h"
#include "capture/projector/display.h"

namespace relievo {

struct ShowReport {
  std::uint64_t pictures = 0;   // that came onto the screen
  std::uint64_t refreshes = 0;  // from the first to the last of them
  std::uint64_t missed = 0;     // refreshes at which a new picture was due and none came
  double refresh_hz = 0;        // measured
  bool synchronised = true;     // the display waits for its refresh
  bool counted = false;         // the display counts its refreshes itself; else they are told from times
};

struct ShowOptions {
  int refreshes_each = 1;
  bool interlaced =
      false;  // a picture holds a frame's two fields, for outputs that are interlaced themselves
  FieldOrder field_order = FieldOrder::kTop;
  std::optional<std::uint64_t> pictures = {};            // end after so many
  std::function<bool()> stopped = {};                    // asked between pictures; true ends it
  std::function<void(const ShowReport&)> progress = {};  // after each picture
};

/// Shows until stopped. Where a refresh was missed the picture that was due then is left out, so that each
/// refresh's picture stays the one that the schedule has for it and a camera in step stays in step. A display
/// that does not wait for its refresh is paced by the clock.
Result<ShowReport> show_slides(Display& display, const Pattern& pattern, const ShowOptions& options);

/// The same of any pictures, of the display's size, in turn. What `options` says of fields does not matter.
Result<ShowReport> show_cycle(Display& display, const std::vector<Image8>& cycle, const ShowOptions& options);

/// Shows one still picture (a field of the schedule or anything else) until stopped: to aim and focus.
Status show_still(Display& display, Image8 picture, const std::function<bool()>& stopped);

}  // namespace relievo
