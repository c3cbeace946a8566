// SPDX-License-Identifier: Apache-2.0
// Proves: a browser gets the quality it asks for, without a gap in its numbers; one that lets the gateway
// choose goes down while it cannot follow; one that decodes no H.264 gets JPEG textures where there are some;
// and the server's clock is the one that is told.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "tests/support/make_grid.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

using Json = nlohmann::json;
constexpr std::size_t kPrefix = 48;

class GatewayQuality : public GatewayTest {
 protected:
  void SetUp() override {
    GatewayTest::SetUp();
    gateway->announce(make_info());
    ServerStatus status;
    status.stream = "face";
    status.rungs = {{.rung = Rung::kReduced}, {.rung = Rung::kTexture}};
    gateway->publish(status);
  }
  void publish(Rung rung) {
    FrameMessage message = make_frame(sequence[static_cast<std::size_t>(rung)]++);
    message.data = data[static_cast<std::size_t>(rung)];
    message.rung = rung;
    gateway->publish("face", message);
  }
  /// A frame of each rung that somebody wants, as a server does.
  void publish_all() {
    publish(Rung::kFull);
    for (const Rung rung : {Rung::kReduced, Rung::kTexture})
      if (gateway->watchers("face", rung) > 0) publish(rung);
  }
  /// Which rung a frame is of: by its vertices.
  static Rung rung_of(const WsMessage& message) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(message.data.data()) + kPrefix;
    const auto header = read_frame_header({bytes, message.data.size() - kPrefix});
    EXPECT_TRUE(header);
    if (!header || header->vertices == 0) return Rung::kTexture;
    return header->vertices > 3000 ? Rung::kFull : Rung::kReduced;
  }

  static std::shared_ptr<const Bytes> encoded(const GridScene& scene, bool empty = false) {
    FrameEncoder encoder(grid_rig(scene), grid_pattern(scene));
    const auto bytes =
        encoder.encode(empty ? Frame3D() : grid_frame(scene), {.geometry = GeometryCodec::kGrid});
    EXPECT_TRUE(bytes);
    return std::make_shared<const Bytes>(bytes ? *bytes : Bytes());
  }
  const std::array<std::shared_ptr<const Bytes>, 3> data{encoded({}), encoded({.height = 120}),
                                                         encoded({}, true)};
  std::array<std::uint64_t, 3> sequence{0, 5000, 700};
};

TEST_F(GatewayQuality, AClientIsSentTheQualityItAsksForInOneRow) {
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  EXPECT_EQ(gateway->watchers("face", Rung::kReduced), 0);
  std::vector<Rung> rungs;
  std::vector<std::uint64_t> numbers;
  const auto receive_until = [&](Rung rung, std::size_t more) {
    std::size_t seen = 0;
    return eventually([&] {
      client.credit(1);
      publish_all();
      const auto frame = client.next_of("frame");
      if (!frame) return false;
      rungs.push_back(rung_of(*frame));
      numbers.push_back(u64_at(frame->data, 8));
      seen += rungs.back() == rung;
      return seen >= more;
    });
  };
  ASSERT_TRUE(receive_until(Rung::kFull, 2));
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"reduced"})"));
  ASSERT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kReduced) == 1; }));
  ASSERT_TRUE(receive_until(Rung::kReduced, 3));
  EXPECT_EQ(metric(R"(relievo_gateway_quality_clients{stream="face",quality="reduced"})"), 1);
  EXPECT_EQ(gateway->watchers("face", Rung::kFull), 0);
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"texture"})"));
  ASSERT_TRUE(receive_until(Rung::kTexture, 3));
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"full"})"));
  ASSERT_TRUE(receive_until(Rung::kFull, 3));
  const auto drops =
      u64_at(client.next_of("frame", 0ms).value_or(WsMessage{2, std::string(48, '\0')}).data, 40);
  EXPECT_EQ(drops, 0U);
  for (std::size_t i = 1; i < numbers.size(); ++i) EXPECT_GT(numbers[i], numbers[i - 1]);
  EXPECT_LE(numbers.back() - numbers.front(), numbers.size() + 10)
      << "not the numbers of the rungs themselves";
}

TEST_F(GatewayQuality, ItIsToldWhichQualityComes) {
  WsClient client(port, "face");
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"reduced"})"));
  ASSERT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kReduced) == 1; }));
  publish_all();
  publish_all();
  client.credit(2);
  const auto said = client.next_of("quality");
  ASSERT_TRUE(said);
  const Json json = Json::parse(said->data);
  EXPECT_EQ(json["now"], "reduced");
  EXPECT_EQ(json["of"], Json({"full", "reduced", "texture"}));
  const auto frame = client.next_of("frame");
  ASSERT_TRUE(frame);
  EXPECT_EQ(rung_of(*frame), Rung::kReduced);
}

TEST_F(GatewayQuality, AClientThatCannotFollowGoesDown) {
  WsClient client(port, "face");
  WsClient beside(port, "face");
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"auto"})"));
  // It takes one frame of four.
  EXPECT_TRUE(eventually([&] {
    for (int i = 0; i < 4; ++i) publish_all();
    client.credit(1);
    const auto frame = client.next_of("frame");
    return frame && rung_of(*frame) != Rung::kFull;
  }));
  EXPECT_EQ(gateway->watchers("face", Rung::kFull), 1) << "the client beside it stays";
}

TEST_F(GatewayQuality, APageInTheBackgroundIsNotJudgedButOneThatIsVerySlowIs) {
  WsClient client(port, "face");
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"auto"})"));
  std::optional<Rung> shown;
  const auto publish_for = [&](std::chrono::milliseconds time, bool takes) {
    for (int i = 0; i < time / 50ms; ++i) {
      publish_all();
      std::this_thread::sleep_for(50ms);
      if (!takes) continue;
      client.credit(1);
      const auto frame = client.next_of("frame");
      ASSERT_TRUE(frame);
      shown = rung_of(*frame);
    }
  };
  publish_for(4s, true);
  publish_for(3200ms, false);  // in the background
  publish_for(2500ms, true);
  EXPECT_EQ(shown, Rung::kFull);
  EXPECT_EQ(gateway->watchers("face", Rung::kFull), 1);
  EXPECT_TRUE(eventually([&] {
    publish_for(3200ms, false);
    publish_for(100ms, true);
    return shown != Rung::kFull;
  }));
}

TEST_F(GatewayQuality, WhoDecodesNoVideoGetsJpegWhereThereIsSome) {
  constexpr const char* kNoVideo = R"({"type":"quality","want":"%s","textures":["jpeg","png"]})";
  const auto wants = [&](const std::string& want) {
    std::string text = kNoVideo;
    return text.replace(text.find("%s"), 2, want);
  };
  WsClient without(port, "face"), with(port, "face");
  ASSERT_TRUE(without.send(wants("reduced")));
  ASSERT_TRUE(with.send(R"({"type":"quality","want":"reduced","textures":["jpeg","h264"]})"));
  ASSERT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kReduced) == 2; }))
      << "a stream without those rungs is sent as it is";

  ServerStatus status;
  status.stream = "face";
  status.rungs = {{.rung = Rung::kReduced}, {.rung = Rung::kFullJpeg}, {.rung = Rung::kReducedJpeg}};
  gateway->publish(status);
  EXPECT_EQ(gateway->watchers("face", Rung::kReducedJpeg), 1) << "as soon as there is one";
  std::vector<std::uint64_t> numbers;
  EXPECT_TRUE(eventually([&] {
    publish(Rung::kFull);
    FrameMessage jpeg = make_frame(40 + numbers.size());
    jpeg.data = data[1];
    jpeg.rung = Rung::kReducedJpeg;
    gateway->publish("face", jpeg);
    without.credit(1);
    const auto frame = without.next_of("frame");
    if (frame && rung_of(*frame) == Rung::kReduced) numbers.push_back(u64_at(frame->data, 8));
    return numbers.size() >= 3;
  }));
  for (std::size_t i = 1; i < numbers.size(); ++i) EXPECT_GT(numbers[i], numbers[i - 1]);
  EXPECT_EQ(gateway->watchers("face", Rung::kReduced), 1) << "the other stays";
  EXPECT_EQ(metric(R"(relievo_gateway_quality_clients{stream="face",quality="reduced"})"), 2);
  ASSERT_TRUE(without.send(wants("texture")));  // which the stream has no more
  EXPECT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kFullJpeg) == 1; }));
  ASSERT_TRUE(without.send(R"({"type":"quality","want":"full"})"));
  EXPECT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kFullJpeg) == 0; }))
      << "who names no codecs decodes all";
}

TEST_F(GatewayQuality, AStreamThatComesBackBeginsInFull) {
  WsClient client(port, "face");
  ASSERT_TRUE(client.send(R"({"type":"quality","want":"texture"})"));
  ASSERT_TRUE(eventually([&] { return gateway->watchers("face", Rung::kTexture) == 1; }));
  publish_all();
  gateway->withdraw("face");
  ASSERT_TRUE(client.next_of("gone"));
  gateway->announce(make_info());
  client.credit(8);
  publish(Rung::kFull);  // of a server that has no such rung, or not yet
  const auto frame = client.next_of("frame");
  ASSERT_TRUE(frame);
  EXPECT_EQ(rung_of(*frame), Rung::kFull);
  publish_all();
  EXPECT_TRUE(eventually([&] {
    publish_all();
    const auto next = client.next_of("frame");
    client.credit(1);
    return next && rung_of(*next) == Rung::kTexture;
  })) << "it still wants what it wanted";
}

TEST_F(GatewayQuality, AWishThatIsNoneEndsTheConnection) {
  for (const char* wrong : {R"({"type":"quality"})", R"({"type":"quality","want":"best"})",
                            R"({"type":"quality","want":3})", R"({"type":"quality","want":"full-jpeg"})",
                            R"({"type":"quality","want":"full","textures":"jpeg"})"}) {
    WsClient client(port, "face");
    ASSERT_TRUE(client.send(wrong));
    std::optional<WsMessage> last;
    while (const auto message = client.next()) {
      last = message;
      if (message->opcode == 8) break;
    }
    ASSERT_TRUE(last);
    EXPECT_EQ(last->close_code(), 1008) << wrong;
  }
}

TEST_F(GatewayQuality, TimesAreByTheClockOfTheStreamsServer) {
  constexpr std::int64_t kAhead_ns = 3'600 * kNanosecondsPerSecond;
  gateway->set_clock("face", kAhead_ns);
  WsClient client(port, "face");
  const std::int64_t before_ns = utc_now_ns();
  ASSERT_TRUE(client.send(R"({"type":"time","t0":1})"));
  const auto answer = client.next_of("time");
  const std::int64_t after_ns = utc_now_ns();
  ASSERT_TRUE(answer);
  const double server_ms = Json::parse(answer->data)["server_ms"];
  EXPECT_GE(server_ms, milliseconds(before_ns + kAhead_ns) - 1);
  EXPECT_LE(server_ms, milliseconds(after_ns + kAhead_ns) + 1);
  EXPECT_EQ(metric(R"(relievo_gateway_clock_offset_seconds{stream="face"})"), 3600);
  FrameMessage frame = make_frame(0);
  frame.capture_time_ns = frame.publish_time_ns = utc_now_ns() + kAhead_ns;
  gateway->publish("face", frame);
  EXPECT_LT(metric(R"(relievo_gateway_latency_seconds_sum{stream="face",until="here"})"), 600);
  EXPECT_GE(metric(R"(relievo_gateway_latency_seconds_sum{stream="face",until="here"})"), 0);
}

TEST_F(GatewayQuality, NoTimeIsCountedBeforeTheServersClockIsKnown) {
  gateway->announce(make_info("far"), ServerClock::kElsewhere);
  FrameMessage frame = make_frame(0);
  frame.capture_time_ns = frame.publish_time_ns = utc_now_ns() + 3'600 * kNanosecondsPerSecond;
  gateway->publish("far", frame);
  EXPECT_EQ(metric(R"(relievo_gateway_latency_seconds_count{stream="far",until="published"})"), 1);
  EXPECT_EQ(metric(R"(relievo_gateway_latency_seconds_count{stream="far",until="here"})"), 0);
  WsClient client(port, "far");
  ASSERT_TRUE(client.send(R"({"type":"time","t0":1})"));
  const auto answer = client.next_of("time");
  ASSERT_TRUE(answer);
  EXPECT_TRUE(Json::parse(answer->data)["server_ms"].is_null()) << answer->data;
  gateway->set_clock("far", 3'600 * kNanosecondsPerSecond);
  gateway->publish("far", frame);
  EXPECT_EQ(metric(R"(relievo_gateway_latency_seconds_count{stream="far",until="here"})"), 1);
}

}  // namespace
}  // namespace relievo::test
