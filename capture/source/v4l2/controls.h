// SPDX-License-Identifier: Apache-2.0
// A device's controls by name: exposure, gain, white balance and whatever else its driver has.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "capture/source/camera_options.h"
#include "capture/source/v4l2/device.h"

namespace relievo::v4l2 {

struct MenuItem {
  std::int64_t value = 0;
  std::string name;
};

struct Control {
  std::uint32_t id = 0;
  std::string name;       // as options have it: "exposure_time_absolute"
  std::string label;      // as the driver has it: "Exposure Time, Absolute"
  std::string_view kind;  // "integer", "boolean", "menu", "button", "bitmask", "text"
  std::int64_t least = 0, most = 0, step = 0, usual = 0;
  std::int64_t value = 0;  // of all kinds but button and text
  std::string text;        // of text
  std::vector<MenuItem> menu;
  bool read_only = false;
  bool inactive = false;  // another control has to be set first
  bool wide = false;      // 64 bits
};

/// All that take a single value, in the driver's order. Where the driver has two of one name, the second gets
/// "_2" and so on.
std::vector<Control> controls_of(const Device& device);

/// Sets them in order. Errors name the control, and what it takes or which there are.
Status set_controls(const Device& device, const std::vector<CameraControl>& wanted);

}  // namespace relievo::v4l2
