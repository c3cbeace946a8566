// SPDX-License-Identifier: Apache-2.0
#include "tests/support/streams.h"

#include "base/time.h"

namespace relievo::test {

StreamInfo example_info(const std::string& stream) {
  StreamInfo info;
  info.stream = stream;
  info.source = "test";
  info.started_ns = utc_now_ns();
  info.rig.frame_rate = 29.97;
  info.rig.camera = {640, 480, {700, 0, 320, 0, 701, 240, 0, 0, 1}, {-0.1, 0.01, 0.001, -0.001, 0.1}};
  info.rig.projector = {1024, 768, {1500, 0, 512, 0, 1500, 384, 0, 0, 1}, {}};
  info.rig.projector_from_camera_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.rig.projector_from_camera_translation = {-0.2, 0, 0};
  info.rig.colour_matrix = {1, 0.1, 0, 0, 1, 0.1, 0, 0, 1};
  info.pattern.palette = {1, 2, 4, 6, 5, 3};
  info.pattern.sequence = {0, 7, 14, 21, 28, 35, 1};
  return info;
}

FrameMessage example_frame(std::uint64_t sequence, std::size_t size) {
  FrameMessage frame;
  frame.sequence = sequence;
  frame.number = 2 * sequence + 1;
  frame.capture_time_ns = utc_now_ns();
  frame.publish_time_ns = frame.capture_time_ns + 1'000'000;
  Bytes data(size);
  std::uint64_t state = sequence * 0x9E3779B97F4A7C15u + size;
  for (std::uint8_t& byte : data) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    byte = static_cast<std::uint8_t>(state >> 56);
  }
  frame.data = std::make_shared<const Bytes>(std::move(data));
  return frame;
}

}  // namespace relievo::test
