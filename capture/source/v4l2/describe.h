// SPDX-License-Identifier: Apache-2.0
// What a device is and can do, for `relievo-server devices`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"
#include "capture/source/v4l2/controls.h"
#include "capture/source/v4l2/tv_standard.h"

namespace relievo::v4l2 {

/// One size, or a range of them in steps.
struct SizeRange {
  int least_width = 0, most_width = 0, width_step = 0;
  int least_height = 0, most_height = 0, height_step = 0;
  std::vector<double> rates;  // pictures a second, at the largest size of a range; empty: not told
};

struct FormatDescription {
  std::string name;   // as --format takes it, or the code's four letters
  std::string label;  // the driver's
  bool readable = false;
  std::vector<SizeRange> sizes;
};

struct DeviceDescription {
  std::string path, label, driver, bus;
  bool multiplanar = false;
  std::string now;  // the format that is set: "YUYV 640x480 progressive"
  std::vector<FormatDescription> formats;
  std::vector<Input> inputs;
  int current_input = -1;
  std::vector<std::string> current_standards;
  std::vector<Control> controls;
};

/// /dev/video*, by number.
std::vector<std::string> device_paths();

/// Fails where it cannot be opened or is no camera.
Result<DeviceDescription> describe(Io& io, const std::string& path);

}  // namespace relievo::v4l2
