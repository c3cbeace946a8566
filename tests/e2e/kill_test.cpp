// SPDX-License-Identifier: Apache-2.0
// Servers, gateways and clients killed at random moments: what is left goes on, and who comes back finds it.
// RELIEVO_KILLS=50 in the environment: so many of each.
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <cstdlib>
#include <random>

#include "codec/recording.h"
#include "idl/transport.h"
#include "tests/support/metric.h"
#include "tests/support/own_domain.h"
#include "tests/support/patience.h"
#include "tests/support/process.h"
#include "tests/support/socket_client.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;

constexpr int kFewKills = 4;
const std::string kStream = "plane";

int kills() {
  const char* const wanted = std::getenv("RELIEVO_KILLS");
  return wanted == nullptr ? kFewKills : std::atoi(wanted);
}

std::vector<std::string> on_loopback(std::vector<std::string> command) {
  command.insert(command.end(), {"--domain", std::to_string(own_domain()), "--interface", "lo"});
  return command;
}

Process serve(const std::string& web, std::vector<std::string> more = {}) {
  std::vector<std::string> command{program("relievo-server"),
                                   "serve",
                                   "--source",
                                   "sim:plane,width=160,height=120,stripes=30",
                                   "--web",
                                   web};
  command.insert(command.end(), more.begin(), more.end());
  return Process(on_loopback(std::move(command)));
}

Process gateway(const std::string& listen) {
  return Process(on_loopback({program("relievo"), "web", "--listen", listen}));
}

/// Descriptors that a process has open.
std::size_t descriptors(const Process& process) {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry :
       fs::directory_iterator("/proc/" + std::to_string(process.pid()) + "/fd"))
    ++count;
  return count;
}

/// One reader of the stream throughout.
class Watcher {
 public:
  Watcher() {
    Subscriber::Callbacks callbacks;
    callbacks.gone = [this](const std::string&) { ++gone_; };
    callbacks.frame = [this](const std::string&, const FrameMessage&) { ++frames_; };
    auto created = Subscriber::create({own_domain(), "lo"}, kStream, std::move(callbacks));
    if (created) subscriber_ = std::move(created).value();
    EXPECT_TRUE(subscriber_);
  }
  std::uint64_t gone() const { return gone_; }
  bool sees(std::uint64_t more) const {
    const std::uint64_t enough = frames_ + more;
    return eventually([&] { return frames_ >= enough; });
  }

 private:
  std::atomic<std::uint64_t> gone_{0}, frames_{0};
  std::unique_ptr<Subscriber> subscriber_;  // last: its callbacks use the rest
};

class Kill : public ::testing::Test {
 protected:
  /// Up to half a second.
  void wait_a_moment() { std::this_thread::sleep_for(std::chrono::milliseconds(random_() % 500)); }
  static void kill(Process& process) {
    process.signal(SIGKILL);
    EXPECT_EQ(process.wait(), 128 + SIGKILL) << process.err();
  }

 private:
  std::mt19937 random_{std::getenv("RELIEVO_KILLS") == nullptr ? 1 : std::random_device{}()};
};

TEST_F(Kill, OfAServerItsReadersSeeTheNextAndItsFileOpens) {
  const TempFolder folder;
  const Watcher watcher;
  for (int i = 0; i < kills(); ++i) {
    ASSERT_EQ(watcher.gone(), static_cast<std::uint64_t>(i));
    const auto file = folder / (std::to_string(i) + ".mcap");
    Process server = serve("127.0.0.1:0", {"--record", file});
    ASSERT_TRUE(watcher.sees(1)) << server.err();
    ASSERT_TRUE(wait_for_size(file, 1));
    wait_a_moment();
    kill(server);
    ASSERT_TRUE(eventually([&] { return watcher.gone() > static_cast<std::uint64_t>(i); }))
        << "a stream without a server";
    const auto reader = RecordingReader::open(file);
    EXPECT_TRUE(reader.ok()) << (reader ? "" : reader.error().message);
  }
}

TEST_F(Kill, OfAGatewayTheServerDoesNotNoticeAndBrowsersComeBack) {
  Process server = serve("none");
  const Watcher watcher;
  ASSERT_TRUE(watcher.sees(1)) << server.err();
  std::string listen = "127.0.0.1:0";
  for (int i = 0; i < kills(); ++i) {
    Process web = gateway(listen);
    const std::uint16_t port = viewer_port(web);
    ASSERT_NE(port, 0) << web.err();
    listen = "127.0.0.1:" + std::to_string(port);  // the next one takes the same
    ASSERT_TRUE(eventually([&] {
      return request(port, "GET", "/api/streams").body.find('"' + kStream + '"') != std::string::npos;
    }));
    WsClient client(port, kStream);
    ASSERT_TRUE(client.credit(2));
    EXPECT_TRUE(client.next_of("frame"));
    wait_a_moment();
    kill(web);
    ASSERT_TRUE(watcher.sees(1));
  }
  EXPECT_EQ(watcher.gone(), 0);
  EXPECT_EQ(server.wait(0ms), std::nullopt) << server.err();
}

TEST_F(Kill, OfClientsTheServerKeepsNothing) {
  const TempFolder folder;
  Process server = serve("127.0.0.1:0");
  const std::uint16_t port = viewer_port(server);
  ASSERT_NE(port, 0) << server.err();
  const Watcher watcher;
  ASSERT_TRUE(watcher.sees(1)) << server.err();
  const auto clients = [&] {
    return metric_in(request(port, "GET", "/metrics").body, "relievo_gateway_clients");
  };
  ASSERT_EQ(clients(), 0);
  const std::size_t before = descriptors(server);
  for (int i = 0; i < kills(); ++i) {
    const auto file = folder / (std::to_string(i) + ".mcap");
    Process recorder(on_loopback({program("relievo"), "record", kStream, "--out", file}));
    Process browser(
        {"/usr/bin/env", "python3", "-c",
         "import socket, sys, time\n"
         "s = socket.create_connection(('127.0.0.1', " +
             std::to_string(port) +
             "))\n"
             "s.sendall(b'GET /ws/plane HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\nUpgrade: websocket\\r\\n'\n"
             "          b'Connection: Upgrade\\r\\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\\r\\n'\n"
             "          b'Sec-WebSocket-Version: 13\\r\\n\\r\\n')\n"
             "print(s.recv(100), flush=True)\n"
             "time.sleep(600)"});
    ASSERT_TRUE(wait_for_size(file, 1)) << recorder.err();
    ASSERT_TRUE(browser.wait_for_text("101")) << browser.err();
    wait_a_moment();
    kill(recorder);
    kill(browser);
    ASSERT_TRUE(watcher.sees(1));
    const auto reader = RecordingReader::open(file);
    EXPECT_TRUE(reader.ok()) << (reader ? "" : reader.error().message);
  }
  EXPECT_TRUE(eventually([&] { return clients() == 0; }));
  EXPECT_TRUE(eventually([&] { return descriptors(server) <= before; }))
      << descriptors(server) << " descriptors, of " << before;
  EXPECT_EQ(watcher.gone(), 0);
  server.signal(SIGTERM);
  EXPECT_EQ(server.wait(), 0) << server.err();
}

}  // namespace
}  // namespace relievo::test
