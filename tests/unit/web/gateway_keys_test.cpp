// SPDX-License-Identifier: Apache-2.0
// Proves: of a stream whose frames build on each other a client gets no frame that it cannot decode, and
// after a gap a key frame is asked for. The frames are the real codec's.
#include <gtest/gtest.h>

#include <atomic>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "codec/texture_codec.h"
#include "tests/support/make_grid.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

constexpr std::size_t kPrefix = 48;

class GatewayKeys : public GatewayTest {
 protected:
  void SetUp() override {
    start({.port = 0, .key_frame_wanted = [this](const std::string& stream) {
             EXPECT_EQ(stream, "face");
             ++wanted;
           }});
    gateway->announce(make_info());
  }

  /// Publishes the stream's next frame.
  void publish() { gateway->publish("face", next()); }
  FrameMessage next() {
    Frame3D frame = options.texture == TextureCodec::kH264 ? Frame3D() : grid_frame({.seed = sequence + 1});
    frame.texture = picture(64, 48);
    const auto bytes = encoder.encode(frame, options);
    EXPECT_TRUE(bytes.ok()) << bytes.error().message;
    FrameMessage message;
    message.sequence = message.number = sequence++;
    message.data = std::make_shared<const Bytes>(*bytes);
    return message;
  }
  /// Of the next frame that comes, which must decode.
  std::uint64_t arrived(WsClient& client) {
    const auto frame = client.next_of("frame");
    EXPECT_TRUE(frame);
    if (!frame) return 0;
    const auto* data = reinterpret_cast<const std::uint8_t*>(frame->data.data()) + kPrefix;
    const auto decoded = decoder.decode({data, frame->data.size() - kPrefix});
    EXPECT_TRUE(decoded.ok()) << decoded.error().message;
    return u64_at(frame->data, 8);
  }

  EncodeOptions options{.geometry = GeometryCodec::kGrid, .key_interval = 100};
  FrameEncoder encoder{grid_rig({}), grid_pattern({})};
  FrameDecoder decoder;
  std::uint64_t sequence = 0;
  std::atomic<int> wanted{0};
};

class GatewayVideo : public GatewayKeys {
 protected:
  void SetUp() override {
    if (const Status usable = check_texture_codec(TextureCodec::kH264); !usable)
      GTEST_SKIP() << usable.error().message;
    GatewayKeys::SetUp();
    options.texture = TextureCodec::kH264;
  }
};

TEST_F(GatewayVideo, AfterADropTheNextKeyFrameComesAndIsAskedFor) {
  WsClient client(port, "face");
  client.credit(1);
  ASSERT_TRUE(client.next_of("info"));
  publish();
  EXPECT_EQ(arrived(client), 0u);
  publish();  // keeps the slot
  publish();  // builds on it, but there is no place: dropped
  publish();  // builds on that one
  EXPECT_GE(wanted, 1);
  client.credit(8);
  EXPECT_EQ(arrived(client), 1u);
  publish();
  EXPECT_FALSE(client.next_of("frame", 200ms)) << "it cannot be decoded";
  encoder.request_key_frame();
  publish();
  EXPECT_EQ(arrived(client), 5u);
  publish();
  EXPECT_EQ(arrived(client), 6u);
  EXPECT_EQ(metric("relievo_gateway_client_drops_total{stream=\"face\"}"), 3);
  EXPECT_EQ(metric("relievo_gateway_key_requests_total{stream=\"face\"}"), wanted);
}

TEST_F(GatewayVideo, KeyFramesAreAskedForOnceASecondAtMost) {
  const std::int64_t begin_ns = steady_now_ns();
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  next();
  for (int i = 0; i < 50; ++i) publish();
  EXPECT_GE(wanted, 1);
  EXPECT_LE(wanted, 1 + seconds(steady_now_ns() - begin_ns));
}

TEST_F(GatewayVideo, WhoJoinsDoesNotWaitForTheSecondOfWhoJoinedBefore) {
  publish();
  publish();
  int soon = 0;
  for (int i = 0; i < 5 && soon == 0; ++i) {  // unless the machine stands still each time
    const int before = wanted;
    const WsClient first(port, "face");
    ASSERT_TRUE(eventually([&] { return publish(), wanted > before; }));
    const std::int64_t asked_ns = steady_now_ns();
    const WsClient second(port, "face");
    ASSERT_TRUE(eventually([&] { return publish(), wanted > before + 1; }));
    soon += steady_now_ns() - asked_ns < kNanosecondsPerSecond * 9 / 10;
  }
  EXPECT_GT(soon, 0);
}

TEST_F(GatewayVideo, ALateJoinerGetsTheLastKeyFrameAndThenTheNext) {
  for (int i = 0; i < 3; ++i) publish();
  EXPECT_EQ(wanted, 0) << "nobody watches";
  WsClient client(port, "face");
  client.credit(8);
  ASSERT_TRUE(client.next_of("info"));
  EXPECT_EQ(arrived(client), 2u) << "the first one, by the number of the last, so that none seems lost";
  EXPECT_EQ(wanted, 1);
  publish();
  EXPECT_FALSE(client.next_of("frame", 200ms));
  encoder.request_key_frame();
  publish();
  EXPECT_EQ(arrived(client), 4u);
}

TEST_F(GatewayVideo, AGapBeforeTheGatewayIsNoticed) {
  WsClient client(port, "face");
  client.credit(8);
  ASSERT_TRUE(client.next_of("info"));
  publish();
  EXPECT_EQ(arrived(client), 0u);
  next();  // lost on the network
  publish();
  EXPECT_FALSE(client.next_of("frame", 200ms));
  EXPECT_EQ(wanted, 1);
  encoder.request_key_frame();
  publish();
  EXPECT_EQ(arrived(client), 3u);
}

TEST_F(GatewayVideo, AClientThatWasThereBeforeTheStreamBeginsWithAKeyFrame) {
  next();
  WsClient client(port, "face");
  client.credit(8);
  ASSERT_TRUE(client.next_of("info"));
  publish();  // the first that the gateway sees builds on one it never saw
  EXPECT_FALSE(client.next_of("frame", 200ms));
  EXPECT_EQ(wanted, 1);
}

TEST_F(GatewayKeys, DeltaGridsMayBeDroppedButNotTheirKey) {
  WsClient client(port, "face");
  ASSERT_TRUE(client.next_of("info"));
  publish();
  publish();
  publish();
  client.credit(8);
  EXPECT_EQ(arrived(client), 0u) << "the key frame stays in the slot";
  publish();
  EXPECT_EQ(arrived(client), 3u);
  publish();
  EXPECT_EQ(arrived(client), 4u);
  EXPECT_EQ(wanted, 0);
}

TEST_F(GatewayKeys, ALateJoinerOfDeltaGridsGetsTheirKeyFirst) {
  publish();
  publish();
  WsClient client(port, "face");
  client.credit(8);
  ASSERT_TRUE(client.next_of("info"));
  EXPECT_EQ(arrived(client), 1u) << "the first one, by the number of the last, so that none seems lost";
  publish();
  EXPECT_EQ(arrived(client), 2u);
  EXPECT_EQ(wanted, 0);
}

}  // namespace
}  // namespace relievo::test
