// SPDX-License-Identifier: Apache-2.0
// TV standards by name, and selecting inputs and standards.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rig.h"
#include "capture/source/v4l2/device.h"

namespace relievo::v4l2 {

/// One input as the driver describes it.
struct Input {
  std::uint32_t number = 0;
  std::string name;
  std::uint64_t standards = 0;  // V4L2's set of those it takes; 0: it is no TV input
  std::string trouble;          // "no signal" and the like; empty: none known
};

/// In the driver's order; empty where the driver has no such choice.
std::vector<Input> inputs_of(const Device& device);
std::optional<Input> current_input(const Device& device);
/// `wanted`: its number or name. The error names those there are.
Status select_input(const Device& device, const std::string& wanted);

/// "NTSC-M", "PAL-B", ... of those in the set; whole families by their names, "NTSC", "PAL" and "SECAM".
std::vector<std::string> standard_names(std::uint64_t set);
/// "auto": what the driver detects on the wire. The error names those there are.
Status select_standard(const Device& device, const std::string& wanted);

struct TvTiming {
  std::int64_t frame_ns = 0;
  FieldOrder order = FieldOrder::kTop;
};
/// Of the standard that is set; nothing where the input is no TV.
std::optional<TvTiming> tv_timing(const Device& device);

}  // namespace relievo::v4l2
