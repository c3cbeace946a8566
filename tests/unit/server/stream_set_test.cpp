// SPDX-License-Identifier: Apache-2.0
// Proves: streams of a server are paused and stopped at whatever moment that is asked for. Real DDS on the
// loopback interface.
#include "server/stream_set.h"

#include <gtest/gtest.h>

#include <thread>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"

namespace relievo {
namespace {

using namespace std::chrono_literals;

ServeConfig one_stream() {
  ServeConfig config;
  config.source = "sim:object,width=160,height=120,scan=progressive,stripes=24,rate=60";
  config.domain = test::own_domain();
  config.interface = "lo";
  return config;
}

class StreamSetTest : public testing::Test {
 protected:
  const ServeConfig config_ = one_stream();
  const std::string name_ = name_of(config_);
  KeyFrameWishes wishes_;
  ServiceBoard board_;
  StreamSet streams_{{.config = config_, .wishes = wishes_, .board = board_}, false};
};

// A page that begins to calibrate as the server starts.
TEST_F(StreamSetTest, WhatIsPausedWhileItOpensIsThereNoMore) {
  streams_.apply(config_.all_streams());
  std::this_thread::sleep_for(100ms);  // it listens for 0.4 s whether another stream has its name
  ASSERT_TRUE(streams_.pause(name_));
  streams_.request_key_frame(name_);
  EXPECT_TRUE(streams_.pause(name_)) << "once more";
  streams_.resume(name_);
  streams_.stop();
  EXPECT_TRUE(streams_.wait());
}

}  // namespace
}  // namespace relievo
