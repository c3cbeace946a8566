// SPDX-License-Identifier: Apache-2.0
#include "codec/message_cdr.h"

#include <algorithm>

#include "base/time.h"

namespace relievo {

void MessageCdr::text(std::string_view text) {
  put(static_cast<std::uint32_t>(text.size() + 1));
  bytes_.insert(bytes_.end(), text.begin(), text.end());
  bytes_.push_back(0);
}

void MessageCdr::octets(std::span<const std::uint8_t> octets) {
  put(static_cast<std::uint32_t>(octets.size()));
  append_bytes(bytes_, octets);
}

void MessageCdr::time(std::int64_t ns) {
  ns = std::max<std::int64_t>(ns, 0);
  put(static_cast<std::uint32_t>(ns / kNanosecondsPerSecond));
  put(static_cast<std::uint32_t>(ns % kNanosecondsPerSecond));
}

void MessageCdr::calibration(const PinholeModel& camera) {
  const auto& k = camera.matrix;
  text("plumb_bob");  // OpenCV's k1 k2 p1 p2 k3
  put(static_cast<std::uint32_t>(camera.distortion.size()));
  numbers(camera.distortion);
  numbers(k);
  numbers({1, 0, 0, 0, 1, 0, 0, 0, 1});  // R: one camera alone
  // P: straightened, the camera is the same
  numbers({k[0], k[1], k[2], 0, k[3], k[4], k[5], 0, k[6], k[7], k[8], 0});
}

}  // namespace relievo
