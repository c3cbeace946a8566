// SPDX-License-Identifier: Apache-2.0
#include "client/frame_names.h"

#include <cstdio>

namespace relievo {

std::string FrameNames::name(const Frame3D& frame) {
  char number[32];
  std::snprintf(number, sizeof number, "%06llu", static_cast<unsigned long long>(frame.number));
  const std::string name = frame.between ? std::string(number) + "_between" : number;
  const std::uint64_t times = ++given_[{frame.number, frame.between}];
  return times == 1 ? name : name + '-' + std::to_string(times);
}

}  // namespace relievo
