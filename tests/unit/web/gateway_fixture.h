// SPDX-License-Identifier: Apache-2.0
// A gateway on a free port and things to feed it.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/support/metric.h"
#include "tests/support/patience.h"
#include "tests/support/socket_client.h"
#include "web/gateway/gateway.h"

namespace relievo::test {

inline StreamInfo make_info(const std::string& name = "face") {
  StreamInfo info;
  info.stream = name;
  info.source = "sim:face";
  info.started_ns = 1'700'000'000'000'000'000;
  info.rig.frame_rate = 29.97;
  info.rig.camera.width = 640;
  info.rig.camera.height = 480;
  info.rig.camera.matrix = {800, 0, 319.5, 0, 800, 239.5, 0, 0, 1};
  info.pattern.sequence.assign(90, 0);
  return info;
}

inline FrameMessage make_frame(std::uint64_t sequence, std::size_t bytes = 1000) {
  FrameMessage frame;
  frame.sequence = sequence;
  frame.capture_time_ns = 1000 + static_cast<std::int64_t>(sequence);
  frame.publish_time_ns = 2000 + static_cast<std::int64_t>(sequence);
  frame.data = std::make_shared<const Bytes>(bytes, static_cast<std::uint8_t>(sequence));
  return frame;
}

class GatewayTest : public testing::Test {
 protected:
  void SetUp() override { start({.port = 0, .empty_hint = "start one with relievo-server serve"}); }
  void start(const GatewayOptions& options) {
    gateway.reset();
    auto made = Gateway::start(options);
    ASSERT_TRUE(made.ok()) << made.error().message;
    gateway = std::move(*made);
    port = gateway->port();
  }
  /// The value of a line of /metrics, -1 where there is none.
  double metric(const std::string& name) const {
    return metric_in(request(port, "GET", "/metrics").body, name);
  }

  std::unique_ptr<Gateway> gateway;
  std::uint16_t port = 0;
};

}  // namespace relievo::test
