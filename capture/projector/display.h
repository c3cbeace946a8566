// SPDX-License-Identifier: Apache-2.0
// An output that shows pictures full screen, each from one vertical refresh to another: the rig's projector.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

struct DisplayMode {
  int width = 0, height = 0;  // pixels
  double refresh_hz = 0;      // as the system says it, often rounded; 0: not known

  bool operator==(const DisplayMode&) const = default;
};

/// A connected output.
struct DisplayOutput {
  std::string name;  // the system's, such as HDMI-1
  bool primary = false;
  DisplayMode mode;                // now
  std::vector<DisplayMode> modes;  // that can be chosen
};

/// A picture has come onto the screen.
struct Flip {
  std::int64_t time_ns = 0;              // steady clock, when that was known
  std::optional<std::uint64_t> refresh;  // the display's own count of refreshes, where it has one
};

/// Lives on the thread that opened it. Pictures reach the screen unscaled, unfiltered and without gamma.
class Display {
 public:
  virtual ~Display() = default;

  virtual const DisplayOutput& output() const = 0;

  /// Keeps `pictures` (RGB, of the mode's size) to be shown by index; replaces earlier ones.
  virtual Status load(const std::vector<Image8>& pictures) = 0;

  /// Puts a loaded picture onto the screen at a refresh, `refreshes` after the last one at the soonest, and
  /// returns when it is there. At once on a display that does not wait for its refresh.
  virtual Result<Flip> show(std::size_t picture, int refreshes) = 0;

  /// True once a person has asked to end (closed the window, pressed Escape).
  virtual bool closed() = 0;
};

/// What to open.
struct DisplayChoice {
  std::string output;         // name; empty: the primary one, or the only other one
  int width = 0, height = 0;  // 0: the mode as it is
  double refresh_hz = 0;      // 0: any
};

}  // namespace relievo
