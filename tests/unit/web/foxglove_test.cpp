// SPDX-License-Identifier: Apache-2.0
// Proves: the Foxglove WebSocket protocol as the gateway speaks it: channels that come and go with streams,
// frames of what was subscribed to, and no harm from a client that asks nonsense.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;

const std::string kOffer = "Sec-WebSocket-Protocol: something.else, foxglove.websocket.v1\r\n";

class Foxglove : public GatewayTest {
 protected:
  void SetUp() override {
    start({.port = 0,
           .samples = SampleFormat{.type_name = "relievo::Frame",
                                   .idl = "struct Frame {};",
                                   .encode = [](const std::string& stream, const FrameMessage& frame) {
                                     const std::string text = stream + ":" + std::to_string(frame.sequence);
                                     return Bytes(text.begin(), text.end());
                                   }}});
  }
  WsClient connect(const std::string& headers = kOffer) const {
    return WsClient(std::make_unique<TcpClient>(port), port, "/foxglove", headers);
  }
  /// The next message of that op; null where none comes.
  static Json next(WsClient& client, const std::string& op) {
    while (const auto message = client.next()) {
      if (message->opcode != 1) continue;
      const Json json = Json::parse(message->data);
      if (json["op"] == op) return json;
    }
    return nullptr;
  }
  static void subscribe(WsClient& client, int id, int channel) {
    client.send(Json{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channel}}}}}.dump());
  }
  /// "ID:TIME:PAYLOAD" of the next frame.
  static std::string next_frame(WsClient& client) {
    while (const auto message = client.next()) {
      if (message->opcode != 2) continue;
      if (message->data[0] != 1 || message->data.size() < 13) return "no message data";
      const std::string padded = message->data.substr(1, 4) + std::string(4, '\0');
      return std::to_string(u64_at(padded, 0)) + ":" + std::to_string(u64_at(message->data, 5)) + ":" +
             message->data.substr(13);
    }
    return "none";
  }
};

TEST_F(Foxglove, AChannelAStreamAndItsFrames) {
  gateway->announce(make_info("face"));
  WsClient client = connect();
  ASSERT_EQ(client.status(), 101);
  const Json hello = next(client, "serverInfo");
  EXPECT_TRUE(hello["capabilities"].is_array());
  const Json advertised = next(client, "advertise");
  ASSERT_EQ(advertised["channels"].size(), 1u);
  const Json channel = advertised["channels"][0];
  EXPECT_EQ(channel["topic"], "relievo/frame/face");
  EXPECT_EQ(channel["encoding"], "cdr");
  EXPECT_EQ(channel["schemaName"], "relievo::Frame");
  EXPECT_EQ(channel["schemaEncoding"], "omgidl");
  EXPECT_EQ(channel["schema"], "struct Frame {};");
  subscribe(client, 7, channel["id"]);
  ASSERT_TRUE(eventually([&] { return metric("relievo_gateway_stream_clients{stream=\"face\"}") == 1; }));
  for (std::uint64_t i = 0; i < 20; ++i) {
    gateway->publish("face", make_frame(i));
    EXPECT_EQ(next_frame(client), "7:" + std::to_string(1000 + i) + ":face:" + std::to_string(i));
  }
  EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_frames_sent_total{stream=\"face\"}") == 20; }));
  client.send(R"({"op":"unsubscribe","subscriptionIds":[7]})");
  EXPECT_TRUE(eventually([&] { return metric("relievo_gateway_stream_clients{stream=\"face\"}") == 0; }));
}

// By this a client tells whether it has lost its connection alone, or all that it knows is of another server.
TEST_F(Foxglove, WhoComesBackIsToldThatItIsTheSameServer) {
  const auto session = [this] {
    WsClient client = connect();
    return next(client, "serverInfo")["sessionId"];
  };
  const Json first = session();
  EXPECT_TRUE(first.is_string());
  EXPECT_EQ(session(), first);
  SetUp();
  EXPECT_NE(session(), first) << "it is another one";
}

TEST_F(Foxglove, StreamsComeAndGo) {
  WsClient client = connect();
  ASSERT_FALSE(next(client, "serverInfo").is_null());
  gateway->announce(make_info("one"));
  const int one = next(client, "advertise")["channels"][0]["id"];
  subscribe(client, 1, one);
  ASSERT_TRUE(eventually([&] { return metric("relievo_gateway_stream_clients{stream=\"one\"}") == 1; }));
  gateway->withdraw("one");
  EXPECT_EQ(next(client, "unadvertise")["channelIds"], Json({one}));
  gateway->announce(make_info("one"));
  const int again = next(client, "advertise")["channels"][0]["id"];
  EXPECT_NE(again, one) << "a channel that is gone does not come back";
  subscribe(client, 1, again);
  gateway->publish("one", make_frame(3));
  EXPECT_EQ(next_frame(client), "1:1003:one:3");
}

TEST_F(Foxglove, NonsenseIsToldOrClosesTheConnection) {
  gateway->announce(make_info());
  WsClient client = connect();
  for (const char* wish : {R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]})",
                           R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":"x"}]})",
                           R"({"op":"subscribe","subscriptions":[{"id":4294967297,"channelId":1}]})",
                           R"({"op":"subscribe","subscriptions":[{"id":2,"channelId":4294967297}]})",
                           R"({"op":"subscribe","subscriptions":[3]})"}) {
    client.send(wish);
    EXPECT_EQ(next(client, "status")["level"], 1) << wish;
  }
  client.send(R"({"op":"of a later version"})");
  client.send(R"({"op":"unsubscribe","subscriptionIds":[5,"a",-1]})");
  subscribe(client, 1, 1);
  client.send(R"({"op":"unsubscribe","subscriptionIds":[4294967297]})");
  gateway->publish("face", make_frame(0));
  EXPECT_EQ(next_frame(client), "1:1000:face:0");
  const struct {
    const char* text;
    int opcode, code;
  } wrong[] = {{"[]", 1, 1008}, {"{}", 1, 1008}, {R"({"op":"subscribe"})", 1, 1008}, {"x", 2, 1003}};
  for (const auto& c : wrong) {
    WsClient other = connect();
    ASSERT_EQ(other.status(), 101);
    other.send(c.text, c.opcode);
    std::optional<WsMessage> last;
    do last = other.next();
    while (last && last->opcode != 8);
    ASSERT_TRUE(last) << c.text;
    EXPECT_EQ(last->close_code(), c.code) << c.text;
  }
}

TEST_F(Foxglove, EitherNameOfTheProtocolIsAgreedOn) {
  const struct {
    const char *offered, *agreed;
  } cases[] = {{"foxglove.sdk.v1", "foxglove.sdk.v1"},
               {"foxglove.websocket.v1", "foxglove.websocket.v1"},
               {"foxglove.websocket.v1, foxglove.sdk.v1", "foxglove.sdk.v1"}};
  for (const auto& c : cases) {
    const WsClient client = connect(std::string("Sec-WebSocket-Protocol: ") + c.offered + "\r\n");
    EXPECT_EQ(client.status(), 101) << c.offered;
    EXPECT_EQ(client.subprotocol(), c.agreed) << c.offered;
  }
}

TEST_F(Foxglove, WhoDoesNotSpeakItIsTold) {
  EXPECT_EQ(connect("Sec-WebSocket-Protocol: foxglove.websocket.v2\r\n").status(), 400);
  EXPECT_EQ(connect("").status(), 400);
  EXPECT_EQ(connect(kOffer + "Origin: https://evil.example\r\n").status(), 403);
  EXPECT_EQ(request(port, "GET", "/foxglove").status, 426);
  start({.port = 0});
  EXPECT_EQ(connect().status(), 404) << "nothing encodes its samples";
}

}  // namespace
}  // namespace relievo::test
