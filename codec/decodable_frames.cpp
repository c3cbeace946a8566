// SPDX-License-Identifier: Apache-2.0
#include "codec/decodable_frames.h"

#include "codec/frame_layout.h"

namespace relievo {

bool DecodableFrames::add(std::uint64_t number, const std::shared_ptr<const Bytes>& frame) {
  const BuildsOn on = what_it_builds_on(*frame);
  lost_ = lost_ || number != last_ + 1;
  last_ = number;
  if (on == BuildsOn::kNothing) {
    key_ = frame;
    lost_ = false;
  }
  if (!lost_) return true;
  return on == BuildsOn::kKeyFrame && key_ && grid_builds_on(*frame, *key_);
}

}  // namespace relievo
