// SPDX-License-Identifier: Apache-2.0
// Proves: streams of a server are paused and stopped at whatever moment that is asked for, and go on whatever
// their recordings' disk does. Real DDS on the loopback interface.
#include "server/stream_set.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdarg>
#include <filesystem>
#include <functional>
#include <future>
#include <mutex>
#include <numeric>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "server/recording_desk.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace {
std::mutex stuck_disk;
std::atomic<int> waiting_syncs{0}, waiting_looks{0};

void wait_for_disk(std::atomic<int>& waiting) {
  ++waiting;
  { const std::lock_guard lock(stuck_disk); }
  --waiting;
}
void wait_for_disk_of(const char* path) {
  if (std::string_view(path).find("/disk/") != std::string_view::npos) wait_for_disk(waiting_looks);
}
}  // namespace

// In place of the system's, for recordings, and for files in a folder "disk".
extern "C" int fdatasync(int descriptor) {
  wait_for_disk(waiting_syncs);
  return static_cast<int>(syscall(SYS_fdatasync, descriptor));
}
extern "C" int stat(const char* path, struct stat* into) noexcept {
  wait_for_disk_of(path);
  return static_cast<int>(syscall(SYS_newfstatat, AT_FDCWD, path, into, 0));
}
extern "C" int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  wait_for_disk_of(path);
  return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode));
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
  StreamSetTest() { std::filesystem::create_directory(disk_); }

  std::uint64_t published() const {
    const auto times = stages_.stages(name_);
    return times ? std::accumulate(times->publish.counts.begin(), times->publish.counts.end(), 0UL) : 0;
  }
  /// Whether it returns while the disk stands still.
  bool returns(std::function<void()> call) {
    calls_.push_back(std::async(std::launch::async, std::move(call)));
    return calls_.back().wait_for(test::kPatience / 12) == std::future_status::ready;
  }

  const test::TempFolder folder_;
  const std::filesystem::path disk_ = folder_ / "disk";
  const ServeConfig config_ = one_stream();
  const std::string name_ = name_of(config_);
  KeyFrameWishes wishes_;
  ServiceBoard board_;
  StageDesk stages_;
  RecordingDesk desk_{disk_};
  StreamSet streams_{
      {.config = config_, .wishes = wishes_, .board = board_, .desk = &desk_, .stages = &stages_}, false};
  std::vector<std::future<void>> calls_;
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
  StreamConfig recorded = config_;
  recorded.record = disk_ / "a.mcap";
  streams_.apply({recorded});
  EXPECT_TRUE(test::eventually([&] { return published() > 0; }));
  stuck_disk.lock();
  EXPECT_TRUE(test::eventually([] { return waiting_syncs > 0; }));
  auto before = published();
  EXPECT_TRUE(test::eventually([&] { return published() > before + 60; })) << published() - before;
  // Nor does another recording, on request, that is to begin now.
  EXPECT_TRUE(returns([&] { EXPECT_TRUE(desk_.start(name_)); }));
  EXPECT_TRUE(test::eventually([] { return waiting_looks > 0; }));
  EXPECT_TRUE(returns([&] { EXPECT_EQ(desk_.state(name_)->activity, RecordingActivity::kRecording); }));
  EXPECT_TRUE(returns([&] { EXPECT_TRUE(desk_.is_open("a.mcap")); }));
  EXPECT_TRUE(returns([&] { EXPECT_TRUE(desk_.growing("a.mcap")); }));
  before = published();
  EXPECT_TRUE(test::eventually([&] { return published() > before + 60; })) << published() - before;
  EXPECT_TRUE(returns([&] { EXPECT_TRUE(desk_.stop(name_)); }));
  stuck_disk.unlock();
  streams_.stop();
  EXPECT_TRUE(streams_.wait());
}

TEST_F(StreamSetTest, RigFilesOnADiskThatStandsStillHoldUpNoStream) {
  StreamConfig camera;
  camera.stream = "camera";
  camera.source = "v4l2:/dev/none";
  camera.camera.rig = disk_ / "rig.yaml";
  streams_.apply({config_});
  EXPECT_TRUE(test::eventually([&] { return published() > 0; }));
  stuck_disk.lock();
  calls_.push_back(std::async(std::launch::async, [&] { streams_.apply({config_, camera}); }));
  EXPECT_TRUE(test::eventually([] { return waiting_looks > 0; }));
  EXPECT_TRUE(returns([&] { streams_.request_key_frame(name_); }));
  EXPECT_TRUE(returns([&] { EXPECT_TRUE(streams_.config_of(name_)); }));
  EXPECT_TRUE(returns([&] { streams_.stop(); }));
  stuck_disk.unlock();
}

}  // namespace
}  // namespace relievo
