// SPDX-License-Identifier: Apache-2.0
// Many who watch at once, and some of them slow: nobody loses a frame for another, and who is slow knows what
// he lost.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>

#include "tests/e2e/server/server_process.h"
#include "tests/support/recorder_counts.h"
#include "tests/support/socket_client.h"

namespace relievo::test {
namespace {

// So slow that a loaded machine keeps up: after standing still, what came meanwhile comes at once, and of
// that each client has room for one.
constexpr double kRate_Hz = 2;
constexpr int kEnough = 15;
constexpr auto kTooLong = 2s;  // the slow one's time for a frame, in which four come

/// What a browser was sent until the stream ended.
struct Seen {
  std::atomic<std::uint64_t> frames = 0;
  std::atomic<std::uint64_t> dropped = 0;  // as the gateway says, since the first
  std::uint64_t first = 0, last = 0;

  std::uint64_t published() const { return last - first + 1; }
};

void watch(std::uint16_t port, int credit, std::chrono::milliseconds a_frame_takes, Seen& seen) {
  WsClient client(port, "take");
  EXPECT_TRUE(client.credit(credit));
  // What came while a loaded machine took its time to say the credit was never asked for.
  std::uint64_t dropped_before = 0;
  while (const auto frame = client.next_of("frame")) {
    seen.last = u64_at(frame->data, 8);
    const std::uint64_t dropped = u64_at(frame->data, 40);
    if (seen.frames == 0) {
      seen.first = seen.last;
      dropped_before = dropped;
    }
    ++seen.frames;
    seen.dropped = dropped - dropped_before;
    std::this_thread::sleep_for(a_frame_takes);
    client.credit(1);
  }
}

TEST(Crowd, NobodyLosesAFrameForAnother) {
  const TempFolder folder;
  const auto take = folder / "take";
  StripedScene scene = striped_scene();
  scene.rig.frame_rate = kRate_Hz;
  ASSERT_TRUE(write_striped_take(scene, take, 12));
  Process server(serve("take:" + take.string(), {"--loop", "--web", "127.0.0.1:0"}));
  const std::uint16_t port = viewer_port(server);
  ASSERT_NE(port, 0) << server.err();

  const auto file = [&](int i) { return folder / (std::to_string(i) + ".mcap"); };
  std::vector<std::unique_ptr<Process>> recorders;
  for (int i = 0; i < 8; ++i) {
    recorders.push_back(std::make_unique<Process>(
        std::vector<std::string>{program("relievo"), "record", "take", "--out", file(i), "--json", "--domain",
                                 std::to_string(own_domain()), "--interface", "lo"}));
  }
  // Programs that start take more than those that watch.
  for (int i = 0; i < 8; ++i)
    ASSERT_TRUE(wait_for_size(file(i), 1)) << recorders[static_cast<std::size_t>(i)]->err();
  std::vector<Seen> browsers(16);
  Seen slow;
  {
    std::vector<std::jthread> threads;
    for (Seen& seen : browsers) threads.emplace_back([&seen, port] { watch(port, 2, 0ms, seen); });
    threads.emplace_back([&slow, port] { watch(port, 1, kTooLong, slow); });
    EXPECT_TRUE(eventually([&] {
      return slow.dropped > 0 &&
             std::ranges::all_of(browsers, [](const Seen& seen) { return seen.frames >= kEnough; });
    }));
    server.signal(SIGTERM);
  }
  EXPECT_EQ(server.wait(), 0) << server.err();
  for (const Seen& seen : browsers) {
    EXPECT_EQ(seen.frames, seen.published());
    EXPECT_EQ(seen.dropped, 0);
  }
  EXPECT_GT(slow.dropped, 0);
  EXPECT_EQ(slow.frames + slow.dropped, slow.published());
  for (const auto& recorder : recorders) {
    const RecorderCounts recorded = stop_recorder(*recorder);
    EXPECT_GT(recorded.frames, 0);
    EXPECT_EQ(recorded.lost, 0);
  }
}

}  // namespace
}  // namespace relievo::test
