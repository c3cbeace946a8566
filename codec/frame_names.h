// SPDX-License-Identifier: Apache-2.0
// What the files of frames are called, without their endings.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "base/frame3d.h"

namespace relievo {

/// "000012", or "000012_between" for the surface half way from the frame before.
std::string frame_name(std::uint64_t number, bool between);

/// A name of its own for each frame of a folder, after the camera's frame. One thread.
class FrameNames {
 public:
  /// frame_name(); where the same was asked for before, as after a restart of the server,
  /// whose numbers start again: "000012-2" and so on.
  std::string name(const Frame3D& frame);

 private:
  std::map<std::pair<std::uint64_t, bool>, std::uint64_t> given_;  // how often, by number and `between`
};

}  // namespace relievo
