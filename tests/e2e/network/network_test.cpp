// SPDX-License-Identifier: Apache-2.0
// Programs on hosts of a network that loses, stops and is cut.
#include <gtest/gtest.h>
#include <signal.h>

#include <map>
#include <memory>
#include <optional>
#include <sstream>

#include "tests/e2e/network/on_a_network.h"
#include "tests/support/patience.h"

namespace relievo::test {
namespace {

class NetworkTest : public OnANetwork {
 protected:
  /// Publishes numbered frames of host 1 once `readers` are there.
  std::unique_ptr<Process> publisher(std::size_t bytes, int rate_hz, int frames, int readers) {
    return std::make_unique<Process>(Network::on(
        1, {program("test_publisher"), "numbers", "0", std::to_string(bytes), std::to_string(rate_hz),
            std::to_string(frames), std::to_string(readers), Network::kInterface}));
  }

  std::unique_ptr<Process> recorder(int host) { return OnANetwork::recorder(host, "numbers"); }

  /// Waits until a host has the publisher's last frame, which is sent again until it comes.
  bool has_last_of(int host, int frames) const {
    return eventually([&] { return has_frame(host, static_cast<std::uint64_t>(frames) - 1); });
  }

  /// Runs `lost_nothing` at a rate, and where that loses frames at a fifth of it: what a link loses is sent
  /// again while the publisher still has it, a number of frames that a loaded machine may be too slow for.
  template <typename Test>
  void at_a_pace_that_fits(int rate_hz, const Test& lost_nothing) {
    if (lost_nothing(rate_hz)) return;
    std::printf("too slow a machine for %d frames a second\n", rate_hz);
    for (int host = 2; std::filesystem::remove(file(host)); ++host) {
    }
    EXPECT_TRUE(lost_nothing(rate_hz / 5)) << "frames were lost at any pace";
  }

  /// A stream of 1.1 Mbit/s in full, 0.2 reduced.
  static std::unique_ptr<Process> wide_server() {
    auto server = std::make_unique<Process>(
        Network::on(1, {program("relievo-server"), "serve", "--source", "sim:plane,rate=5,noise=3",
                        "--stream", "wide", "--web", "none", "--interface", Network::kInterface}));
    EXPECT_TRUE(server->wait_for_text("stream wide")) << server->err();
    return server;
  }
  static std::unique_ptr<Process> stats(int host, const std::string& quality) {
    return std::make_unique<Process>(Network::on(host, {program("relievo"), "stats", "wide", "--quality",
                                                        quality, "--interface", Network::kInterface}));
  }
  /// Of what `relievo stats` says each second.
  struct Line {
    std::string quality;
    double rate = 0, latency_ms = 0;
  };
  static std::optional<Line> last_line(const std::string& out) {
    const auto end = out.rfind('\n');
    if (end == std::string::npos || end == 0) return std::nullopt;
    const auto begin = out.rfind('\n', end - 1);
    const std::string text = out.substr(begin == std::string::npos ? 0 : begin + 1, end - begin - 1);
    char quality[16] = {};
    Line line;
    const auto latency = text.find("latency");
    if (latency == std::string::npos || std::sscanf(text.c_str(), "%15s %lf/s", quality, &line.rate) != 2)
      return std::nullopt;
    if (std::sscanf(text.c_str() + latency, "latency %lf", &line.latency_ms) != 1) return std::nullopt;
    line.quality = quality;
    return line;
  }

  static void end_without_loss(Process& stats) {
    stats.signal(SIGINT);
    EXPECT_EQ(stats.wait(), 0);
    std::istringstream lines(stats.out());
    for (std::string line; std::getline(lines, line);)
      EXPECT_NE(line.find(" 0 lost"), std::string::npos) << line;
  }
};

TEST_F(NetworkTest, OfLostPacketsFramesAreWhole) {
  constexpr int kFrames = 120;
  at_a_pace_that_fits(10, [&](int rate_hz) {  // at 30 Hz too, where the machine keeps up
    Network network(3);
    network.lose(2, 10);
    network.lose(3, 50);
    const auto one_percent = recorder(2), five_percent = recorder(3);
    const auto server = publisher(200'000, rate_hz, kFrames, 2);
    EXPECT_TRUE(server->wait_for_text("done")) << server->err();
    for (const int host : {2, 3}) EXPECT_TRUE(has_last_of(host, kFrames)) << "host " << host;
    const RecorderCounts at_one = stop_recorder(*one_percent), at_five = stop_recorder(*five_percent);
    EXPECT_EQ(at_one.frames + at_one.lost, kFrames);
    EXPECT_EQ(at_five.frames + at_five.lost, kFrames);
    return at_one.lost == 0 && at_five.frames >= kFrames * 99 / 100;
  });
}

// Proves that a client goes down by what it loses, and that one beside it notices nothing.
TEST_F(NetworkTest, AClientOnAThinCableTakesTheQualityThatFits) {
  Network network(3);
  network.narrow(2, 400);
  const auto server = wide_server();
  const auto beside = stats(3, "full");
  ASSERT_TRUE(beside->wait_for_text("full"));
  const auto thin = stats(2, "auto");
  EXPECT_TRUE(eventually([&] {  // with frames, of which it tells
    return thin->out().find("reduced ") != std::string::npos ||
           thin->out().find("texture ") != std::string::npos;
  })) << thin->out()
      << thin->err();
  end_without_loss(*beside);
  std::printf("%s", thin->out().c_str());
}

// Where nothing is lost, frames come later and later: proves that this too makes a client go down, and that
// what it then gets is of now.
TEST_F(NetworkTest, AClientBehindALongQueueTakesTheQualityThatFits) {
  Network network(2);
  network.narrow(2, 400, 60'000);
  const auto server = wide_server();
  const auto thin = stats(2, "auto");
  EXPECT_TRUE(eventually(
      [&] {
        const auto line = last_line(thin->out());
        return line && line->quality != "full" && line->rate > 1 && line->latency_ms < 1000;
      },
      kLongPatience))
      << thin->out() << thin->err();
  std::istringstream lines(thin->out());
  for (std::string line; std::getline(lines, line);) {
    // The slow quality's older frames give way to newer ones.
    if (!line.starts_with("full")) continue;
    EXPECT_NE(line.find(" 0 lost"), std::string::npos) << line;
  }
  std::printf("%s", thin->out().c_str());
}

// Proves that a client whose way is narrower than the lowest quality gets frames one by one, as many as fit,
// is told so, and disturbs nobody.
TEST_F(NetworkTest, AClientOnACableTooThinForAnyQualityGetsWhatFits) {
  Network network(3);
  network.narrow(2, 64);
  const auto server = wide_server();
  const auto beside = stats(3, "full");
  ASSERT_TRUE(beside->wait_for_text("full"));
  const auto thin = stats(2, "auto");
  int good = 0;
  std::string seen;
  EXPECT_TRUE(eventually(
      [&] {  // some lines with frames that are of now, not one that was lucky
        const std::string out = thin->out();
        const auto line = out == seen ? std::nullopt : last_line(out);
        seen = out;
        good += line && line->quality == "slow" && line->rate > 0 && line->latency_ms < 5000;
        return good >= 3;
      },
      kLongPatience))
      << thin->out() << thin->err();
  EXPECT_NE(thin->err().find("carries less than the lowest quality"), std::string::npos) << thin->err();
  end_without_loss(*beside);
  std::printf("%s", thin->out().c_str());
}

// A receiver forgets a sender that it has not heard of for 10 s, and has to find it anew.
TEST_F(NetworkTest, OfEightOneIsStoppedOneCutOffAndOneLosesPacketsAndTheOthersLoseNothing) {
  constexpr int kStopped = 3, kCutOff = 4, kLossy = 5, kLast = 9;
  constexpr int kSeconds = 30, kTrouble_s = 15;
  at_a_pace_that_fits(10, [&](int rate_hz) {
    const int frames = kSeconds * rate_hz;
    Network network(kLast);
    network.lose(kLossy, 50);
    std::map<int, std::unique_ptr<Process>> recorders;
    for (int host = 2; host <= kLast; ++host) recorders[host] = recorder(host);
    const auto server = publisher(50'000, rate_hz, frames, kLast - 1);
    for (int host = 2; host <= kLast; ++host) EXPECT_TRUE(wait_for_size(file(host), 1)) << host;
    std::this_thread::sleep_for(2s);
    recorders[kStopped]->signal(SIGSTOP);
    network.cut(kCutOff);
    std::this_thread::sleep_for(std::chrono::seconds(kTrouble_s));
    recorders[kStopped]->signal(SIGCONT);
    network.join(kCutOff);
    const std::int64_t back_ns = utc_now_ns();
    EXPECT_TRUE(server->wait_for_text("done")) << server->err();
    for (int host = 2; host <= kLast; ++host) EXPECT_TRUE(has_last_of(host, frames)) << "host " << host;

    bool the_others_lost_nothing = true;
    for (const auto& [host, one] : recorders) {
      const RecorderCounts counts = stop_recorder(*one);
      EXPECT_EQ(counts.frames + counts.lost, frames) << "host " << host;
      if (host == kStopped || host == kCutOff) {
        // Of a stopped one's frames its system and the publisher keep some.
        if (host == kCutOff) {
          EXPECT_GT(counts.lost, 0) << "host " << host;
        }
        const auto after_s = came_back_after_s(host, back_ns);
        EXPECT_TRUE(after_s) << "host " << host;
        std::printf("host %d is back after %.2f s; lost %llu frames\n", host, after_s.value_or(0),
                    static_cast<unsigned long long>(counts.lost));
      } else {
        const std::uint64_t allowed = host == kLossy ? frames / 100 : 0;
        the_others_lost_nothing &= counts.lost <= allowed;
      }
    }
    return the_others_lost_nothing;
  });
}

}  // namespace
}  // namespace relievo::test
