// SPDX-License-Identifier: Apache-2.0
// What the projector that a server drives is doing: said by who drives it and by the gateway.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace relievo {

enum class ProjectorActivity : std::uint8_t { kNone, kOff, kOn, kFailed };

/// "none" (the server drives no projector), "off", "on" or "failed".
inline std::string_view to_string(ProjectorActivity activity) {
  switch (activity) {
    case ProjectorActivity::kNone:
      return "none";
    case ProjectorActivity::kOff:
      return "off";
    case ProjectorActivity::kOn:
      return "on";
    case ProjectorActivity::kFailed:
      return "failed";
  }
  return "unknown";
}

struct ProjectorState {
  ProjectorActivity activity = ProjectorActivity::kNone;
  std::string output;   // "auto", or as `relievo-server project --list` has it
  std::string stream;   // whose pattern it shows, or showed last; empty: nothing yet
  std::string shows;    // "pattern", "white", "black", "slide1", "slide1_complement", ...
  std::string message;  // for a person: why it failed, or how there could be one
};

}  // namespace relievo
