// SPDX-License-Identifier: Apache-2.0
// One server and all who watch it at once, over DDS and as browsers do, on hosts some of whom are in trouble.
#include <signal.h>

#include <algorithm>
#include <array>
#include <vector>

#include "tests/e2e/network/on_a_network.h"
#include "tests/support/patience.h"
#include "tests/support/web_watch.h"

namespace relievo::test {
namespace {

// On each host but the server's: a recorder and two browsers. So few frames a second that a loaded machine
// sends and reads them: a browser has room for two that come at once.
constexpr const char* kSource = "sim:plane,rate=2,noise=3";
constexpr int kStopped = 3, kCutOff = 4, kLossy = 5, kSlow = 6, kLast = 9;
constexpr auto kSlowTakes = 5s;  // a tenth of the stream's rate
constexpr auto kTrouble = 15s;
constexpr std::int64_t kAfterwards_ns = 3 * kNanosecondsPerSecond;  // watched of those that came back

enum class Losses { kNone, kSome, kAny };

/// A browser on a host.
class Browser : public WebWatch {
 public:
  Browser(int host, std::chrono::milliseconds frame_takes)
      : WebWatch(Network::on(host, {program("web_watcher"), "10.77.0.1", "8080", "plane",
                                    frame_takes > 0ms ? "1" : "2", std::to_string(frame_takes.count())})) {}

  bool has_frame_of(std::int64_t time_ns) const {
    const auto all = frames();
    return !all.empty() && all.back().published_ns > time_ns;
  }
  std::optional<double> came_back_after_s(std::int64_t time_ns) const {
    for (const WatchedFrame& f : frames())
      if (f.published_ns > time_ns) return seconds(f.came_ns - time_ns);
    return std::nullopt;
  }
};

/// Frames that a browser did not get after `from_ns`, by their numbers; checks that on each connection the
/// gateway says so.
std::uint64_t lost_of(std::vector<WatchedFrame> frames, std::int64_t from_ns) {
  std::erase_if(frames, [&](const WatchedFrame& frame) { return frame.published_ns < from_ns; });
  std::uint64_t lost = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const WatchedFrame &before = frames[i - 1], &now = frames[i];
    EXPECT_GT(now.sequence, before.sequence);
    const std::uint64_t missing = now.sequence - before.sequence - 1;
    if (now.connection == before.connection) {
      EXPECT_EQ(now.dropped - before.dropped, missing);
    }
    lost += missing;
  }
  return lost;
}

class NetworkCrowd : public OnANetwork {
 protected:
  void start() {
    server_ = std::make_unique<Process>(
        Network::on(1, {program("relievo-server"), "serve", "--source", kSource, "--stream", "plane", "--web",
                        "10.77.0.1:8080", "--open", "--interface", Network::kInterface}));
    ASSERT_TRUE(server_->wait_for_text("viewer http")) << server_->err();
    for (int host = 2; host <= kLast; ++host) {
      recorders_[index(host)] = recorder(host, "plane");
      for (auto& browser : browsers_[index(host)]) browser = std::make_unique<Browser>(host, 0ms);
    }
    browsers_[index(kSlow)][0] = std::make_unique<Browser>(kSlow, kSlowTakes);
    for (int host = 2; host <= kLast; ++host) {
      ASSERT_TRUE(wait_for_size(file(host), 1)) << recorder_on(host).err();
      for (const auto& browser : browsers_[index(host)])
        ASSERT_TRUE(eventually([&] { return browser->has_frame_of(0); })) << browser->process().err();
    }
    all_watch_ns_ = utc_now_ns();  // programs that start take more than those that watch
  }

  /// The rest must go on whoever is asked for: all of them have frames of later than that.
  bool all_have_frames_of(std::int64_t time_ns) const {
    return eventually([&] {
      for (int host = 2; host <= kLast; ++host) {
        for (const auto& browser : browsers_[index(host)])
          if (!browser->has_frame_of(time_ns)) return false;
        if (!came_back_after_s(host, time_ns)) return false;
      }
      return true;
    });
  }

  void stop_and_go_on(int signal) {
    recorder_on(kStopped).signal(signal);
    browsers_[index(kStopped)][0]->process().signal(signal);
  }

  /// Checks a recorder's counts against the numbers in its file; what it lost.
  std::uint64_t recorder_lost(int host) {
    const RecorderCounts counts = stop_recorder(recorder_on(host));
    std::uint64_t first = 0, last = 0, frames = 0;
    each_frame(host, [&](const RecordedMessage& frame) {
      first = frames++ == 0 ? frame.sequence : first;
      last = frame.sequence;
      return true;
    });
    EXPECT_EQ(counts.frames, frames) << "host " << host;
    EXPECT_EQ(counts.lost, last - first + 1 - frames) << "host " << host;
    return counts.lost;
  }

  std::uint64_t browser_lost(int host, std::size_t i) const {
    return lost_of(browsers_[index(host)][i]->frames(), all_watch_ns_);
  }

  static void expect_losses(int host, const char* who, std::uint64_t lost, Losses losses) {
    if (losses == Losses::kNone) {
      EXPECT_EQ(lost, 0) << who << " on host " << host;
    } else if (losses == Losses::kSome) {
      EXPECT_GT(lost, 0) << who << " on host " << host;
    }
    if (lost > 0) std::printf("%s on host %d lost %llu\n", who, host, static_cast<unsigned long long>(lost));
  }
  /// That its frames of after the trouble come; how soon is printed.
  void expect_return(int host, std::int64_t back_ns) const {
    const auto check = [&](const char* who, std::optional<double> after_s) {
      ASSERT_TRUE(after_s) << who << " on host " << host;
      std::printf("%s on host %d is back after %.2f s\n", who, host, *after_s);
    };
    for (const auto& browser : browsers_[index(host)]) check("browser", browser->came_back_after_s(back_ns));
    check("recorder", came_back_after_s(host, back_ns));
  }

  static std::size_t index(int host) { return static_cast<std::size_t>(host); }
  Process& recorder_on(int host) { return *recorders_[index(host)]; }

  std::unique_ptr<Process> server_;
  std::int64_t all_watch_ns_ = 0;
  std::array<std::unique_ptr<Process>, kLast + 1> recorders_;
  std::array<std::array<std::unique_ptr<Browser>, 2>, kLast + 1> browsers_;
};

// Proves: of 8 recorders and 16 browsers one of each is stopped, one reads too slowly, some lose packets and
// some are cut off; the others lose nothing, all come back, and each knows exactly what it lost.
TEST_F(NetworkCrowd, WhoIsInTroubleComesBackAndTheOthersLoseNothing) {
  Network network(kLast);
  network.lose(kLossy, 50);
  start();
  if (HasFatalFailure()) return;
  ASSERT_TRUE(all_have_frames_of(all_watch_ns_));
  stop_and_go_on(SIGSTOP);
  network.cut(kCutOff);
  std::this_thread::sleep_for(kTrouble);
  stop_and_go_on(SIGCONT);
  network.join(kCutOff);
  const std::int64_t back_ns = utc_now_ns();
  EXPECT_TRUE(all_have_frames_of(back_ns + kAfterwards_ns));

  for (int host = 2; host <= kLast; ++host) {
    for (std::size_t i = 0; i < browsers_[index(host)].size(); ++i) {
      const bool in_trouble = host == kCutOff || (i == 0 && (host == kSlow || host == kStopped));
      expect_losses(host, "browser", browser_lost(host, i),
                    in_trouble       ? Losses::kSome
                    : host == kLossy ? Losses::kAny
                                     : Losses::kNone);
    }
    // One that is stopped finds what its system and the server kept for it: of large buffers it may be all.
    expect_losses(host, "recorder", recorder_lost(host),
                  host == kCutOff                      ? Losses::kSome
                  : host == kStopped || host == kLossy ? Losses::kAny
                                                       : Losses::kNone);
    if (host == kStopped || host == kCutOff) expect_return(host, back_ns);
  }
}

}  // namespace
}  // namespace relievo::test
