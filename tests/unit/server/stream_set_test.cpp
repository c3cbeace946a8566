// SPDX-License-Identifier: Apache-2.0
// Proves: streams of a server are paused and stopped at whatever moment that is asked for, and go on whatever
// their recordings' disk does. Real DDS on the loopback interface.
#include "server/stream_set.h"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <mutex>
#include <numeric>
#include <thread>

#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace {
std::mutex stuck_disk;
std::atomic<int> waiting_syncs{0};
}  // namespace

// In place of the system's, for recordings.
extern "C" int fdatasync(int descriptor) {
  ++waiting_syncs;
  { const std::lock_guard lock(stuck_disk); }
  --waiting_syncs;
  return static_cast<int>(syscall(SYS_fdatasync, descriptor));
}

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
  StageDesk stages_;
  StreamSet streams_{{.config = config_, .wishes = wishes_, .board = board_, .stages = &stages_}, false};
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

TEST_F(StreamSetTest, ADiskThatStandsStillHoldsUpTheRecordingAlone) {
  const test::TempFolder folder;
  StreamConfig recorded = config_;
  recorded.record = folder / "a.mcap";
  const auto published = [this] {
    const auto times = stages_.stages(name_);
    return times ? std::accumulate(times->publish.counts.begin(), times->publish.counts.end(), 0UL) : 0;
  };
  stuck_disk.lock();
  streams_.apply({recorded});
  EXPECT_TRUE(test::eventually([] { return waiting_syncs > 0; }));
  const auto before = published();
  EXPECT_TRUE(test::eventually([&] { return published() > before + 60; })) << published() - before;
  stuck_disk.unlock();
  streams_.stop();
  EXPECT_TRUE(streams_.wait());
}

}  // namespace
}  // namespace relievo
