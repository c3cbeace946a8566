// SPDX-License-Identifier: Apache-2.0
// Proves: slow, greedy and senseless connections are refused and counted, and who watches notices nothing of
// them.
#include <gtest/gtest.h>

#include <chrono>
#include <deque>
#include <thread>

#include "tests/support/noise.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

class GatewayCrowd : public GatewayTest {
 protected:
  double refused(const std::string& reason) const { return metric(refused_for(reason)); }
  /// The next frame reaches a client that watches.
  void expect_frame(WsClient& client) {
    gateway->publish("face", make_frame(sequence_, 20'000));
    const auto frame = client.next_of("frame");
    ASSERT_TRUE(frame) << sequence_;
    EXPECT_EQ(u64_at(frame->data, 8), sequence_);
    EXPECT_EQ(u64_at(frame->data, 40), 0u) << "a frame was dropped for the client";
    ++sequence_;
    client.credit(1);
  }

 private:
  std::uint64_t sequence_ = 0;
};

TEST_F(GatewayCrowd, AThousandThatOnlyMakeNoiseDisturbNobody) {
  gateway->announce(make_info());
  WsClient watcher(port, "face");
  ASSERT_TRUE(watcher.next_of("info"));
  watcher.credit(8);
  std::deque<TcpClient> crowd;  // of whom so many at a time stay, as far as they are let
  for (int i = 0; i < 1000; ++i) {
    crowd.emplace_back(port);
    ASSERT_TRUE(crowd.back().connected());
    crowd.back().send(noise(i));
    if (crowd.size() > 500) crowd.pop_front();
    if (i % 10 == 0) expect_frame(watcher);
  }
  EXPECT_EQ(request(port, "GET", "/healthz").status, 200) << "there is room for who wants something";
  WsClient another(port, "face");
  EXPECT_EQ(another.status(), 101);
  expect_frame(watcher);
  crowd.clear();
  EXPECT_TRUE(eventually([&] { return refused("places") + refused("malformed") >= 1000; }))
      << refused("places") << " and " << refused("malformed");
}

TEST_F(GatewayCrowd, WhoOnlyConnectsIsNoNuisance) {
  TcpClient(port).send("");
  {
    const TcpClient idle(port);  // as browsers do in advance
    ASSERT_EQ(request(port, "GET", "/healthz").status, 200);
  }
  TcpClient(port).send("GET / HT");
  EXPECT_TRUE(eventually([&] { return refused("malformed") == 1; }));
}

TEST_F(GatewayCrowd, WhoSpeaksNoWebSocketOnOneIsCounted) {
  gateway->announce(make_info());
  WsClient watcher(port, "face");
  ASSERT_TRUE(watcher.next_of("info"));
  watcher.credit(8);
  WsClient noise(port, "face");
  ASSERT_TRUE(noise.next_of("info"));
  noise.send("a kind of frame that there is not", 3);
  EXPECT_TRUE(eventually([&] { return refused("message") == 1; }));
  expect_frame(watcher);
}

TEST_F(GatewayCrowd, WhoDoesNotReadHisFramesIsCutOff) {
  start({.port = 0, .message_time = 200ms});
  gateway->announce(make_info());
  WsClient stuck(port, "face", {}, 4096);
  stuck.credit(8);
  ASSERT_TRUE(eventually([&] {  // more than the system's buffers take
    gateway->publish("face", make_frame(0, 4'000'000));
    return refused("slow") == 1;
  }));
  EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_clients") == 0; }));
}

TEST_F(GatewayCrowd, WhoTricklesHisRequestIsCutOff) {
  start({.port = 0, .request_time = 2s});  // in which the others' requests are there on a loaded machine too
  gateway->announce(make_info());
  WsClient watcher(port, "face");
  ASSERT_TRUE(watcher.next_of("info"));
  watcher.credit(8);
  TcpClient slow(port);
  slow.send("GET / HTTP/1.1\r\nX: ");
  ASSERT_TRUE(eventually([&] {
    slow.send("x");  // a byte at a time never lets a read time out
    if (slow.receive(1ms)) ADD_FAILURE() << slow.buffer();
    return slow.at_end();
  }));
  EXPECT_EQ(refused("slow"), 1);
  expect_frame(watcher);
}

TEST_F(GatewayCrowd, WhoDoesNotReadHisAnswerIsCutOff) {
  start({.port = 0, .request_time = 200ms});
  TcpClient greedy(port, 4096);
  // More than the system's buffers take.
  std::string requests;
  for (int i = 0; i < 100; ++i) requests += "GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n";
  ASSERT_TRUE(eventually([&] { return !greedy.send(requests) || refused("slow") > 0; }));
  EXPECT_TRUE(eventually([&] { return refused("slow") > 0; }));
}

TEST_F(GatewayCrowd, WhoReadsHisAnswerSlowlyGetsAllOfIt) {
  constexpr std::size_t kBytes = 20'000'000;  // more than the system's buffers take
  constexpr double kBytesPerSecond = 5e6;
  start({.port = 0, .empty_hint = std::string(kBytes, 'x'), .request_time = 1s});
  TcpClient slow(port, 4096);
  slow.send("GET /api/streams HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  const auto began = std::chrono::steady_clock::now();
  while (slow.receive()) {
    const std::chrono::duration<double> due(static_cast<double>(slow.buffer().size()) / kBytesPerSecond);
    std::this_thread::sleep_until(began + std::chrono::duration_cast<std::chrono::nanoseconds>(due));
  }
  EXPECT_GT(slow.buffer().size(), kBytes);
  EXPECT_EQ(refused("slow"), 0);
}

TEST_F(GatewayCrowd, AnAddressHasItsShareOfConnections) {
  start({.port = 0, .web = {.max_per_address = 3}});
  std::deque<TcpClient> all;
  for (int i = 0; i < 3; ++i) all.emplace_back(port);
  TcpClient fourth(port);
  EXPECT_FALSE(fourth.receive());
  EXPECT_TRUE(fourth.at_end());
  all.clear();
  ASSERT_TRUE(eventually([&] { return request(port, "GET", "/healthz").status == 200; }));
  EXPECT_GE(refused("address"), 1);
}

TEST_F(GatewayCrowd, AnAddressHasItsShareOfRequests) {
  start({.port = 0, .web = {.max_rate = 1}});
  int told = 0;
  for (int i = 0; i < 20; ++i) told += request(port, "GET", "/healthz").status == 429;
  EXPECT_GT(told, 0);
  EXPECT_TRUE(eventually([&] { return request(port, "GET", "/healthz").status == 200; }));
  EXPECT_TRUE(eventually([&] { return refused("rate") >= told; }));
}

TEST_F(GatewayCrowd, AClientHasItsShareOfMessages) {
  gateway->announce(make_info());
  WsClient flood(port, "face");
  ASSERT_TRUE(flood.next_of("info"));
  for (int i = 0; i < 200'000 && flood.send(R"({"type":"x"})"); ++i) {
  }
  const auto goodbye = flood.next();
  if (goodbye) {
    EXPECT_EQ(goodbye->close_code(), 1008);  // it may be lost in what it sends itself
  }
  EXPECT_EQ(refused("message"), 1);
}

TEST_F(GatewayCrowd, PingsAreMessages) {
  gateway->announce(make_info());
  WsClient watcher(port, "face");
  ASSERT_TRUE(watcher.next_of("info"));
  watcher.credit(8);
  watcher.send("a ping now and then", 9);
  TcpClient flood(port);
  std::string pings;
  for (int i = 0; i < 1000; ++i) pings += ws_message("ping", 9);
  flood.send(
      "GET /ws/face HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n");
  ASSERT_EQ(read_response(flood).status, 101);
  ASSERT_TRUE(eventually([&] {
    flood.send(pings);
    flood.receive(1ms);
    return refused("message") > 0;
  }));
  EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_clients") == 1; }));
  EXPECT_EQ(refused("message"), 1);
  expect_frame(watcher);
}

}  // namespace
}  // namespace relievo::test
