// SPDX-License-Identifier: Apache-2.0
#include "codec/frame_names.h"

#include <cstdio>

namespace relievo {

std::string frame_name(std::uint64_t number, bool between) {
  char name[40];
  std::snprintf(name, sizeof name, "%06llu%s", static_cast<unsigned long long>(number),
                between ? "_between" : "");
  return name;
}

std::string FrameNames::name(const Frame3D& frame) {
  const std::uint64_t times = ++given_[{frame.number, frame.between}];
  const std::string name = frame_name(frame.number, frame.between);
  return times == 1 ? name : name + '-' + std::to_string(times);
}

}  // namespace relievo
