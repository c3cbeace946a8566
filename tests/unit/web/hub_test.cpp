// SPDX-License-Identifier: Apache-2.0
// Proves: what builds on a frame that was lost on its way to the gateway goes to no client, and the stream is
// asked for a key frame instead. A server that took another one's place before that was known to be gone is a
// stream of its own: with its description go its frames alone, in the qualities that it has.
#include "web/gateway/hub.h"

#include <gtest/gtest.h>

#include "base/time.h"
#include "codec/frame3d_codec.h"
#include "tests/support/make_grid.h"
#include "tests/unit/web/gateway_fixture.h"

namespace relievo::test {
namespace {

class HubTest : public testing::Test {
 protected:
  HubTest() { hub.announce(make_info()); }

  /// The next frame of a stream that begins, decodes alone where `key`.
  FrameMessage encode(bool key, TextureCodec texture) {
    GridScene scene;
    scene.shift_px = static_cast<float>(next);
    Frame3D frame = grid_frame(scene);
    frame.texture = picture(64, 48);
    if (key) encoder.request_key_frame();
    auto bytes =
        encoder.encode(frame, {.geometry = GeometryCodec::kGrid, .texture = texture, .key_interval = 1000});
    EXPECT_TRUE(bytes) << bytes.error().message;
    FrameMessage message = make_frame(next++);
    message.data = std::make_shared<const Bytes>(*std::move(bytes));
    return message;
  }
  /// Published and taken by a client that has credit for everything; nothing where it gets nothing.
  std::optional<std::uint64_t> through(const FrameMessage& frame) {
    hub.publish("face", frame);
    auto delivery = hub.take(*watcher, true);
    while (delivery && !delivery->frame) delivery = hub.take(*watcher, true);
    if (!delivery) return std::nullopt;
    return delivery->frame->sequence;
  }

  int asked = 0;
  Hub hub{"", [this](const std::string&) { ++asked; }};
  std::shared_ptr<Hub::Watcher> watcher = hub.watch("face", [] {});
  FrameEncoder encoder{grid_rig({}), grid_pattern({})};
  std::uint64_t next = 0;
};

TEST_F(HubTest, GridsThatBuildOnALostKeyGoToNobody) {
  constexpr auto kJpeg = TextureCodec::kJpeg;
  EXPECT_EQ(through(encode(true, kJpeg)), 0U);
  EXPECT_EQ(through(encode(false, kJpeg)), 1U);
  encode(false, kJpeg);  // lost: nothing builds on it
  EXPECT_EQ(through(encode(false, kJpeg)), 3U);
  EXPECT_EQ(asked, 0);
  encode(true, kJpeg);  // lost
  EXPECT_EQ(through(encode(false, kJpeg)), std::nullopt);
  EXPECT_EQ(through(encode(false, kJpeg)), std::nullopt);
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(through(encode(true, kJpeg)), 7U);
  EXPECT_EQ(through(encode(false, kJpeg)), 8U);
}

TEST_F(HubTest, PicturesThatBuildOnALostOneGoToNobody) {
  constexpr auto kVideo = TextureCodec::kH264;
  EXPECT_EQ(through(encode(true, kVideo)), 0U);
  EXPECT_EQ(through(encode(false, kVideo)), 1U);
  encode(false, kVideo);  // lost
  EXPECT_EQ(through(encode(false, kVideo)), std::nullopt);
  EXPECT_EQ(through(encode(false, kVideo)), std::nullopt);
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(through(encode(true, kVideo)), 5U);
  EXPECT_EQ(through(encode(false, kVideo)), 6U);
}

/// What a page makes of the numbers that come with frames: how many were lost before the gateway.
class CountedDrops : public HubTest {
 protected:
  /// Takes what there is; false where there is no frame.
  bool take(Hub::Watcher& of) {
    auto delivery = hub.take(of, true);
    while (delivery && !delivery->frame) delivery = hub.take(of, true);
    if (!delivery) return false;
    const std::uint64_t sequence = delivery->frame->sequence;
    const std::uint64_t dropped = delivery->drops - std::exchange(drops, delivery->drops);
    if (last) lost_before += sequence - *last - 1 - dropped;
    last = sequence;
    return true;
  }

  std::optional<std::uint64_t> last;
  std::uint64_t drops = 0, lost_before = 0;
};

TEST_F(CountedDrops, WhoJoinsHasLostNothing) {
  for (const bool key : {true, false, false}) hub.publish("face", encode(key, TextureCodec::kH264));
  const auto late = hub.watch("face", [] {});
  EXPECT_TRUE(take(*late));
  EXPECT_EQ(last, 2U) << "the key frame, which stands for what is there";
  for (const bool key : {false, true, false}) {
    hub.publish("face", encode(key, TextureCodec::kH264));
    take(*late);
    EXPECT_EQ(lost_before, 0U);
  }
  EXPECT_EQ(last, 5U);
  EXPECT_EQ(drops, 1U) << "what it could not decode was kept from it";
}

TEST_F(CountedDrops, AFrameComesWithTheDropsBeforeIt) {
  hub.publish("face", encode(true, TextureCodec::kH264));
  EXPECT_TRUE(take(*watcher));
  for (const bool key : {false, false, false}) hub.publish("face", encode(key, TextureCodec::kH264));
  EXPECT_TRUE(take(*watcher)) << "the first one, behind which two were dropped";
  EXPECT_EQ(drops, 0U);
  for (const bool key : {false, true}) hub.publish("face", encode(key, TextureCodec::kH264));
  EXPECT_TRUE(take(*watcher));
  EXPECT_EQ(drops, 3U);
  EXPECT_EQ(lost_before, 0U);
}

class AnotherServer : public HubTest {
 protected:
  /// Under the same name, after a crash say.
  void takes_its_place() {
    StreamInfo info = make_info();
    info.started_ns += kNanosecondsPerSecond;
    info.rig.camera.width /= 2;
    hub.announce(info);
    next = 0;
  }
  void has(std::vector<RungStatus> rungs) {
    hub.publish({.stream = "face", .state = StreamState::kRunning, .rungs = std::move(rungs)});
  }
  /// Whether a watcher is sent anything but text.
  bool gets_a_frame(Hub::Watcher& of) {
    auto delivery = hub.take(of, true);
    while (delivery && !delivery->frame) delivery = hub.take(of, true);
    return delivery.has_value();
  }
};

TEST_F(AnotherServer, OldFramesDoNotComeWithItsDescription) {
  hub.publish("face", encode(true, TextureCodec::kJpeg));
  takes_its_place();
  const auto late = hub.watch("face", [] {});
  EXPECT_FALSE(gets_a_frame(*watcher));
  EXPECT_FALSE(gets_a_frame(*late));
  EXPECT_EQ(through(encode(true, TextureCodec::kJpeg)), 0U);
  EXPECT_TRUE(gets_a_frame(*late));
}

TEST_F(AnotherServer, TheSameOneThatIsToldWhereItStandsKeepsItsFrames) {
  hub.publish("face", encode(true, TextureCodec::kJpeg));
  StreamInfo info = make_info();
  info.rig.world_from_camera.emplace();
  hub.announce(info);
  const auto late = hub.watch("face", [] {});
  EXPECT_TRUE(gets_a_frame(*watcher));
  EXPECT_TRUE(gets_a_frame(*late));
}

TEST_F(AnotherServer, WhatBuildsOnOldFramesGoesToNobody) {
  EXPECT_EQ(through(encode(true, TextureCodec::kJpeg)), 0U);
  takes_its_place();
  next = 1;  // of whose frames the first one, a key, was lost
  EXPECT_EQ(through(encode(false, TextureCodec::kJpeg)), std::nullopt);
  EXPECT_EQ(asked, 1);
}

TEST_F(AnotherServer, WithoutTheQualityThatAClientIsOnItGetsTheStreamAsItIs) {
  has({{.rung = Rung::kReduced}});
  hub.choose(*watcher, Rung::kReduced, false);
  FrameMessage reduced = encode(true, TextureCodec::kJpeg);
  reduced.rung = Rung::kReduced;
  EXPECT_EQ(through(reduced), 1U) << "numbers go on";
  takes_its_place();
  EXPECT_TRUE(hub.rungs(*watcher).empty()) << "it has not said yet";
  has({});
  EXPECT_EQ(through(encode(true, TextureCodec::kJpeg)), 0U);
  EXPECT_EQ(through(encode(true, TextureCodec::kJpeg)), 1U);
}

}  // namespace
}  // namespace relievo::test
