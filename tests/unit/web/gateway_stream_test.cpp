// SPDX-License-Identifier: Apache-2.0
// Proves: what a WebSocket client gets and when: credit, the latest-frame slot and its drops, streams that
// come and go, clients that do not read.
#include <gtest/gtest.h>

#include <deque>
#include <nlohmann/json.hpp>

#include "base/time.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;
using GatewayStream = GatewayTest;

constexpr std::size_t kPrefix = 48;

TEST_F(GatewayStream, InfoComesFirstAndDescribesTheRig) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  const auto message = client.next();
  ASSERT_TRUE(message);
  const auto info = Json::parse(message->data);
  EXPECT_EQ(info["type"], "info");
  EXPECT_EQ(info["stream"], "face");
  EXPECT_EQ(info["stripes"], 90);
  EXPECT_EQ(info["pattern"]["sequence"].size(), 90u);
  EXPECT_EQ(info["pattern"]["scheme"], "complementary");
  EXPECT_EQ(info["colour_matrix"].size(), 9u);
  EXPECT_EQ(info["camera_gamma"], 1);
  EXPECT_EQ(info["field_order"], "top");
  EXPECT_EQ(info["frame_rate"], 29.97);
  EXPECT_EQ(info["camera"]["width"], 640);
  EXPECT_EQ(info["camera"]["cx"], 319.5);
  EXPECT_FALSE(info.contains("stereo_rms_px") || info.contains("scale_error"));
  EXPECT_FALSE(info.contains("world_from_camera_rotation") || info.contains("world_from_camera_translation"));
}

// RFC 6455, 4.1 has clients wait for the answer; nothing is gained by refusing those that do not.
TEST_F(GatewayStream, WhatAClientSaysWithItsRequestCounts) {
  gateway->announce(make_info());
  gateway->publish("face", make_frame(3));
  for (const int credits : {1, 400}) {  // also more than fits beside the head into one read
    std::string early;
    for (int i = 0; i < credits; ++i) early += ws_message(R"({"type":"credit","n":1})");
    WsClient client(std::make_unique<TcpClient>(port), port, "/ws/face", {}, early);
    ASSERT_EQ(client.status(), 101);
    EXPECT_TRUE(client.next_of("info"));
    const auto frame = client.next_of("frame");
    ASSERT_TRUE(frame) << credits;
    EXPECT_EQ(u64_at(frame->data, 8), 3u);
  }
  EXPECT_EQ(metric(refused_for("message")), 0);
}

// Cookies of other programs at localhost come along.
TEST_F(GatewayStream, ARequestMayHaveAsManyHeadersAsAnyOther) {
  gateway->announce(make_info());
  WsClient client(port, "face", "Cookie: other=" + std::string(7000, 'x') + "\r\n");
  ASSERT_EQ(client.status(), 101);
  EXPECT_TRUE(client.next_of("info"));
}

TEST_F(GatewayStream, AnUpgradeThatIsNoneIsAnsweredAndCounted) {
  gateway->announce(make_info());
  const auto upgrade = [&](const std::string& more) {
    TcpClient client(port);
    client.send("GET /ws/face HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n" +
                more + "\r\n");
    return read_response(client).status;
  };
  const std::string key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
  EXPECT_EQ(upgrade("Sec-WebSocket-Version: 13\r\n"), 400) << "no key";
  EXPECT_EQ(upgrade("Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: " + std::string(100, 'x') + "\r\n"),
            400);
  EXPECT_EQ(upgrade("Sec-WebSocket-Version: 7\r\n" + key), 426);
  EXPECT_EQ(metric(refused_for("message")), 3);
  EXPECT_EQ(metric("relievo_gateway_clients"), 0);
}

TEST_F(GatewayStream, InfoSaysHowGoodTheRigIs) {
  StreamInfo described = make_info();
  described.rig.stereo_rms_px = 0.25;
  described.rig.scale_error = 5e-4;
  described.rig.camera_gamma = 2.2;
  gateway->announce(described);
  WsClient client(port, "face");
  const auto message = client.next();
  ASSERT_TRUE(message);
  const auto info = Json::parse(message->data);
  EXPECT_EQ(info["stereo_rms_px"], 0.25);
  EXPECT_EQ(info["scale_error"], 5e-4);
  EXPECT_EQ(info["camera_gamma"], 2.2);
}

TEST_F(GatewayStream, InfoSaysWhereTheCameraStands) {
  StreamInfo described = make_info();
  described.rig.world_from_camera = {.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1},
                                     .translation = {1.5, -0.25, 2}};
  gateway->announce(described);
  WsClient client(port, "face");
  const auto message = client.next();
  ASSERT_TRUE(message);
  const auto info = Json::parse(message->data);
  EXPECT_EQ(info["world_from_camera_rotation"], Json::parse("[0,-1,0,1,0,0,0,0,1]"));
  EXPECT_EQ(info["world_from_camera_translation"], Json::parse("[1.5,-0.25,2]"));
}

TEST_F(GatewayStream, AFrameCarriesItsTimesAndBytes) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  client.credit(1);
  ASSERT_TRUE(client.next_of("info"));
  const std::int64_t before = utc_now_ns();
  gateway->publish("face", make_frame(5, 300));
  const auto frame = client.next_of("frame");
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->data.size(), kPrefix + 300);
  EXPECT_EQ(u64_at(frame->data, 0), kPrefix);
  EXPECT_EQ(u64_at(frame->data, 8), 5u);
  EXPECT_EQ(u64_at(frame->data, 16), 1005u);
  EXPECT_EQ(u64_at(frame->data, 24), 2005u);
  EXPECT_GE(static_cast<std::int64_t>(u64_at(frame->data, 32)), before);
  EXPECT_EQ(u64_at(frame->data, 40), 0u);
  EXPECT_EQ(frame->data.substr(kPrefix), std::string(300, '\5'));
}

TEST_F(GatewayStream, WithoutCreditNoFrameAndTheSlotKeepsTheLatest) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  for (std::uint64_t i = 0; i < 10; ++i) gateway->publish("face", make_frame(i));
  EXPECT_FALSE(client.next(200ms)) << "a frame came without credit";
  client.credit(1);
  const auto frame = client.next_of("frame");
  ASSERT_TRUE(frame);
  EXPECT_EQ(u64_at(frame->data, 8), 9u);
  EXPECT_EQ(u64_at(frame->data, 40), 9u) << "nine were replaced";
  EXPECT_FALSE(client.next(200ms)) << "one credit is one frame";
  gateway->publish("face", make_frame(10));
  EXPECT_FALSE(client.next(200ms));
  EXPECT_EQ(metric("relievo_gateway_client_drops_total{stream=\"face\"}"), 9);
  EXPECT_EQ(metric("relievo_gateway_frames_sent_total{stream=\"face\"}"), 1);
  EXPECT_EQ(metric("relievo_gateway_sent_bytes_total{stream=\"face\"}"), 1000);
}

TEST_F(GatewayStream, WithCreditEveryFrameArrivesInOrder) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  client.credit(2);
  for (std::uint64_t i = 0; i < 100; ++i) {
    gateway->publish("face", make_frame(i, 20'000));
    const auto frame = client.next_of("frame");
    ASSERT_TRUE(frame) << i;
    EXPECT_EQ(u64_at(frame->data, 8), i);
    EXPECT_EQ(u64_at(frame->data, 40), 0u);
    client.credit(1);
  }
}

TEST_F(GatewayStream, ALateJoinerSeesTheLastFrame) {
  gateway->announce(make_info());
  gateway->publish("face", make_frame(3));
  WsClient client(port, "face");
  client.credit(1);
  const auto frame = client.next_of("frame");
  ASSERT_TRUE(frame);
  EXPECT_EQ(u64_at(frame->data, 8), 3u);
}

TEST_F(GatewayStream, AStreamMayComeGoAndComeBack) {
  WsClient client(port, "later");
  client.credit(2);
  const auto waiting = client.next();
  ASSERT_TRUE(waiting);
  EXPECT_EQ(Json::parse(waiting->data)["type"], "waiting");
  EXPECT_EQ(Json::parse(waiting->data)["hint"], "start one with relievo-server serve");
  gateway->announce(make_info("later"));
  ASSERT_TRUE(client.next_of("info"));
  gateway->publish("later", make_frame(0));
  ASSERT_TRUE(client.next_of("frame"));
  gateway->withdraw("later");
  ASSERT_TRUE(client.next_of("gone"));
  gateway->publish("later", make_frame(1));  // of a stream that is gone: ignored
  EXPECT_FALSE(client.next(200ms));
  gateway->announce(make_info("later"));
  ASSERT_TRUE(client.next_of("info"));
  gateway->publish("later", make_frame(0));
  EXPECT_TRUE(client.next_of("frame"));
}

TEST_F(GatewayStream, StatusArrivesAndRepeatedInfoDoesNot) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  gateway->announce(make_info());
  ServerStatus status;
  status.stream = "face";
  status.state = StreamState::kEnded;
  status.drops_capture = 4;
  gateway->publish(status);
  const auto message = client.next();
  ASSERT_TRUE(message);
  const auto json = Json::parse(message->data);
  EXPECT_EQ(json["type"], "status");
  EXPECT_EQ(json["state"], "ended");
  EXPECT_EQ(json["drops_capture"], 4);
}

TEST_F(GatewayStream, TimeIsAnswered) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  const double before_ms = milliseconds(utc_now_ns());
  client.send(R"({"type":"time","t0":12.5})");
  const auto message = client.next_of("time");
  ASSERT_TRUE(message);
  const auto json = Json::parse(message->data);
  EXPECT_EQ(json["t0"], 12.5);
  EXPECT_GE(json["server_ms"].get<double>(), before_ms - 1);
  EXPECT_LE(json["server_ms"].get<double>(), milliseconds(utc_now_ns()) + 1);
}

// A page asks twice a second at first, and over a narrow way a frame takes longer than that.
TEST_F(GatewayStream, WhoAsksForTheTimeWhileAFrameIsOnItsWayKeepsTheConnection) {
  gateway->announce(make_info());
  gateway->publish("face", make_frame(0, 20'000'000));  // more than the system's buffers take
  WsClient client(port, "face", {}, 4096);
  ASSERT_TRUE(client.next_of("info"));
  client.credit(1);
  constexpr int kQuestions = 60;
  for (int i = 1; i <= kQuestions; ++i) client.send(R"({"type":"time","t0":)" + std::to_string(i) + "}");
  ASSERT_TRUE(client.next_of("frame"));
  double answered = 0;
  while (answered < kQuestions) {
    const auto message = client.next_of("time");
    ASSERT_TRUE(message) << answered;
    answered = Json::parse(message->data)["t0"];
  }
}

TEST_F(GatewayStream, WrongMessagesCloseTheConnection) {
  gateway->announce(make_info());
  const struct {
    std::string text;
    int opcode;
    int code;
  } cases[] = {{"{", 1, 1008},
               {"[]", 1, 1008},
               {"{}", 1, 1008},
               {R"({"type":"credit"})", 1, 1008},
               {R"({"type":"credit","n":-1})", 1, 1008},
               {R"({"type":"credit","n":1e9})", 1, 1008},
               {R"({"type":"credit","n":9})", 1, 1008},
               {R"({"type":"time","t0":"x"})", 1, 1008},
               {std::string(3000, '['), 1, 1008},
               {"binary", 2, 1003},
               {std::string(5000, ' '), 1, 1009}};
  for (const auto& c : cases) {
    WsClient client(port, "face");
    ASSERT_TRUE(client.next_of("info"));
    client.send(c.text, c.opcode);
    const auto message = client.next();
    ASSERT_TRUE(message) << c.text.substr(0, 40);
    EXPECT_EQ(message->opcode, 8) << c.text.substr(0, 40);
    EXPECT_EQ(message->close_code(), c.code) << c.text.substr(0, 40);
  }
  WsClient client(port, "face");
  client.send(R"({"type":"of a later version"})");
  EXPECT_TRUE(client.next_of("info"));
  client.send(R"({"type":"time","t0":1})");
  EXPECT_TRUE(client.next_of("time")) << "an unknown type must be ignored";
}

TEST_F(GatewayStream, AClientThatDoesNotReadHindersNobody) {
  gateway->announce(make_info());
  WsClient stuck(port, "face", {}, 4096);
  WsClient reader(port, "face");
  stuck.credit(8);
  reader.credit(8);
  ASSERT_TRUE(reader.next_of("info"));
  constexpr std::size_t kBytes = 1'000'000;
  std::uint64_t last = 0;
  for (std::uint64_t i = 0; i < 60; ++i) {
    gateway->publish("face", make_frame(i, kBytes));  // or this would wait for ever
    const auto got = reader.next_of("frame");
    ASSERT_TRUE(got);
    last = u64_at(got->data, 8);
    reader.credit(1);
  }
  EXPECT_EQ(last, 59u);
  EXPECT_GT(metric("relievo_gateway_client_drops_total{stream=\"face\"}"), 0);
}

TEST_F(GatewayStream, MoreClientsThanAllowedAreTold) {
  start({.port = 0, .web = {.max_clients = 2}});
  WsClient first(port, "face");
  {
    WsClient second(port, "face");
    EXPECT_EQ(second.status(), 101);
    EXPECT_EQ(WsClient(port, "face").status(), 503);
    EXPECT_EQ(request(port, "GET", "/ws/face").status, 503) << "as a page is told that asks why";
  }
  EXPECT_TRUE(eventually([&] { return WsClient(port, "face").status() == 101; })) << "a place became free";
}

TEST_F(GatewayStream, ClientsThatVanishAreForgotten) {
  gateway->announce(make_info());
  {
    std::deque<WsClient> clients;
    for (int i = 0; i < 10; ++i) clients.emplace_back(port, "face");
    EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_clients") == 10; }));
  }
  EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_clients") == 0; }));
  EXPECT_EQ(metric("relievo_gateway_stream_clients{stream=\"face\"}"), 0);
}

TEST_F(GatewayStream, DestructionSaysGoodbyeAndWaitsForNobody) {
  gateway->announce(make_info());
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  WsClient stuck(port, "face", {}, 4096);
  stuck.credit(8);
  for (std::uint64_t i = 0; i < 20; ++i) gateway->publish("face", make_frame(i, 1'000'000));
  TcpClient idle(port);
  TcpClient half(port);
  half.send("GET / HT");
  gateway.reset();
  std::optional<WsMessage> message;
  do message = client.next();
  while (message && message->opcode != 8);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->close_code(), 1001);
  EXPECT_FALSE(TcpClient(port).connected());
}

TEST_F(GatewayStream, ManyThreadsMayPublish) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      const std::string name = "s" + std::to_string(t % 2);
      for (std::uint64_t i = 0; i < 200; ++i) {
        gateway->announce(make_info(name));
        gateway->publish(name, make_frame(i));
        if (i % 50 == 49) gateway->withdraw(name);
      }
    });
  }
  for (int i = 0; i < 20; ++i) {
    WsClient client(port, i % 2 ? "s0" : "s1");
    client.credit(4);
    EXPECT_TRUE(client.next());
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(request(port, "GET", "/healthz").status, 200);
}

}  // namespace
}  // namespace relievo::test
