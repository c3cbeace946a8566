// SPDX-License-Identifier: Apache-2.0
// Proves: what builds on a frame that was lost on its way to the gateway goes to no client, and the stream is
// asked for a key frame instead.
#include "web/gateway/hub.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace relievo::test
