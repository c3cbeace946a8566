// SPDX-License-Identifier: Apache-2.0
// A secured server with a token, all who have no business there, one after the other, and beside them a
// recorder and a browser that notice nothing.
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdio>
#include <deque>
#include <filesystem>
#include <fstream>
#include <memory>

#include "tests/support/metric.h"
#include "tests/support/noise.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/recorder_counts.h"
#include "tests/support/replace_in.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_watch.h"

namespace relievo::test {
namespace {

const std::string kStream = "plane";
const std::string kToken = "correct-horse-battery";
const std::string kWithToken = "Authorization: Bearer " + kToken + "\r\n";
constexpr int kGarbage = 1000;
constexpr std::size_t kGarbageAtOnce = 400;
constexpr const char* kKinds[] = {"token", "origin", "message", "malformed", "slow", "places"};

class Hostile : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(keys({"init", "--keys", authority_}).status, 0);
    ASSERT_EQ(keys({"init", "--keys", foreign_}).status, 0);
    for (const auto& name : {viewer_, tampered_})
      ASSERT_EQ(keys({"add-client", name.filename(), "--keys", authority_, "--out", name}).status, 0);
    std::ofstream(tokens_) << kToken << '\n';
    ASSERT_TRUE(start_server());
    recorder_ = start({program("relievo"), "record", kStream, "--out", file_, "--json", "--keys", viewer_});
    browser_ = std::make_unique<WebWatch>(std::vector<std::string>{
        program("web_watcher"), "127.0.0.1", std::to_string(port_), kStream + "?token=" + kToken, "2", "0"});
    ASSERT_TRUE(wait_for_size(file_, 1)) << recorder_->err();
    ASSERT_TRUE(goes_on());
    frames_before_ = browser_frames();
  }

  bool start_server() {
    // A frame a second: a loaded machine is away for more than half of one at times, and a browser has credit
    // for two.
    server_ = start({program("relievo-server"), "serve", "--source",
                     "sim:plane,width=160,height=120,stripes=30,rate=1", "--web", "127.0.0.1:0",
                     "--token-file", tokens_, "--max-clients", "1000", "--keys", authority_});
    port_ = viewer_port(*server_);
    EXPECT_NE(port_, 0) << server_->err();
    return port_ != 0;
  }

  /// Of the stream's domain.
  static std::unique_ptr<Process> start(std::vector<std::string> command) {
    command.insert(command.end(), {"--domain", std::to_string(own_domain()), "--interface", "lo"});
    return std::make_unique<Process>(command);
  }
  static Finished keys(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {program("relievo"), "keys"});
    return run(arguments);
  }

  /// What `relievo streams` says where it can be nothing of the stream but `why`.
  void expect_told(const std::string& with_keys, const std::string& why) {
    Finished seen;
    EXPECT_TRUE(eventually([&] {
      auto looks = start({program("relievo"), "streams", "--wait", "1", "--keys", with_keys});
      looks->wait();
      seen = {0, looks->out(), looks->err()};
      return seen.err.find(why) != std::string::npos;
    })) << seen.err;
    EXPECT_EQ(seen.out.find(kStream), std::string::npos) << seen.out;
  }

  std::size_t browser_frames() const { return browser_->frames().size(); }
  bool goes_on() const {
    const std::size_t enough = browser_frames() + 2;
    return eventually([&] { return browser_frames() >= enough; });
  }

  double metric(const std::string& name) const {
    return metric_in(request(port_, "GET", "/metrics", kWithToken).body, name);
  }
  double refused(const std::string& kind) const { return metric(refused_for(kind)); }
  /// Of DDS.
  double refused_peers(const std::string& reason) const {
    return metric("relievo_dds_refused_total{reason=\"" + reason + "\"}");
  }

  /// That a recorder and a browser have had every frame since they watch, on the connection they began with.
  void expect_nothing_noticed() {
    ASSERT_TRUE(goes_on());
    const auto frames = browser_->frames();
    for (std::size_t i = frames_before_; i < frames.size(); ++i) {
      EXPECT_EQ(frames[i].connection, frames[0].connection);
      EXPECT_EQ(frames[i].sequence, frames[i - 1].sequence + 1);
    }
    const RecorderCounts recorded = stop_recorder(*recorder_);
    EXPECT_GT(recorded.frames, 0);
    EXPECT_EQ(recorded.lost, 0);
    EXPECT_EQ(server_->wait(0ms), std::nullopt) << server_->err();
  }

  const TempFolder folder_;
  const std::filesystem::path authority_ = folder_ / "authority", foreign_ = folder_ / "foreign",
                              viewer_ = folder_ / "viewer", tampered_ = folder_ / "tampered",
                              tokens_ = folder_ / "tokens", file_ = folder_ / "a.mcap";
  std::unique_ptr<Process> server_, recorder_;
  std::unique_ptr<WebWatch> browser_;
  std::uint16_t port_ = 0;
  std::size_t frames_before_ = 0;
};

// On DDS each is told on its own side. The server counts who reads in plain; with changed permissions nobody
// comes so far.
TEST_F(Hostile, PeersWithoutTheRightKeysDisturbNobody) {
  EXPECT_EQ(refused_peers("handshake"), 0);
  EXPECT_EQ(refused_peers("plain"), 0);
  expect_told("none", "has no keys");
  const auto plain =
      start({program("relievo"), "record", kStream, "--out", folder_ / "none.mcap", "--keys", "none"});
  EXPECT_TRUE(eventually([&] { return refused_peers("plain") == 1; })) << plain->err();
  EXPECT_EQ(refused_peers("handshake"), 0);
  expect_told(foreign_, "another authority");
  replace_in(tampered_ / "permissions.p7s", "watcher", "wotcher");
  expect_told(tampered_, "not as the authority signed");
  // One who claims to be the stream itself, in plain and with the keys of somebody else.
  for (const std::string& claims : {std::string("none"), foreign_.string()}) {
    const auto impostor = std::make_unique<Process>(
        std::vector<std::string>{program("test_publisher"), kStream, std::to_string(own_domain()), "1000",
                                 "20", "1000000"},
        std::vector<std::string>{"RELIEVO_KEYS=" + claims});
    EXPECT_TRUE(impostor->wait_for_text("live")) << impostor->err();
    EXPECT_TRUE(goes_on());
  }
  for (const char* kind : kKinds) EXPECT_EQ(refused(kind), 0) << kind;
  expect_nothing_noticed();
}

// Whose number is lower begins the handshake; where that is the server, it hears no more of the peer. Numbers
// are drawn when programs start: to a server that drew a low one, few peers come that begin.
TEST_F(Hostile, HandshakesThatFailAreCounted) {
  int tries = 0;
  for (int servers = 0; servers < 12 && refused_peers("handshake") == 0; ++servers) {
    if (servers > 0) {
      server_->signal(SIGTERM);
      EXPECT_EQ(server_->wait(), 0) << server_->err();
      ASSERT_TRUE(start_server());
    }
    for (int peers = 0; peers < 4 && refused_peers("handshake") == 0; ++peers, ++tries)
      expect_told(foreign_, "another authority");
  }
  EXPECT_GT(refused_peers("handshake"), 0) << "after " << tries << " tries";
  std::printf("a handshake was refused after %d tries\n", tries);
}

TEST_F(Hostile, WhoIsTurnedAwayAtTheGatewayIsCountedAndDisturbsNobody) {
  EXPECT_EQ(WsClient(port_, kStream).status(), 401);
  EXPECT_EQ(WsClient(port_, kStream, "Authorization: Bearer wrong\r\n").status(), 401);
  EXPECT_EQ(refused("token"), 2);
  EXPECT_EQ(WsClient(port_, kStream, kWithToken + "Origin: https://evil.example\r\n").status(), 403);
  EXPECT_EQ(refused("origin"), 1);

  WsClient large(port_, kStream, kWithToken);
  ASSERT_EQ(large.status(), 101);
  large.send(std::string(5000, 'x'));
  EXPECT_TRUE(eventually([&] { return refused("message") == 1; }));
  EXPECT_EQ(request(port_, "GET", "/", "X: " + std::string(9000, 'x') + "\r\n").status, 431);
  EXPECT_EQ(refused("malformed"), 1);

  TcpClient slow(port_);
  slow.send("GET / HTTP/1.1\r\nX: ");
  EXPECT_TRUE(eventually([&] {
    slow.send("x");  // a byte at a time
    slow.receive(200ms);
    return slow.at_end();
  }));
  EXPECT_EQ(refused("slow"), 1);
  expect_nothing_noticed();
}

TEST_F(Hostile, AThousandConnectionsOfNoiseAreCountedAndDisturbNobody) {
  std::deque<TcpClient> crowd;
  for (int i = 0; i < kGarbage; ++i) {
    crowd.emplace_back(port_);
    ASSERT_TRUE(crowd.back().connected());
    crowd.back().send(noise(i));
    if (crowd.size() > kGarbageAtOnce) crowd.pop_front();
  }
  EXPECT_EQ(WsClient(port_, kStream, kWithToken).status(), 101) << "there is room for who may watch";
  crowd.clear();
  EXPECT_TRUE(eventually([&] { return refused("malformed") == kGarbage; })) << refused("malformed");
  expect_nothing_noticed();
}

}  // namespace
}  // namespace relievo::test
