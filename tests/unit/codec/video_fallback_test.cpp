// SPDX-License-Identifier: Apache-2.0
// A hardware encoder that opens and then fails (tests/support/flaky_h264.cpp): the stream goes on.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "codec/texture_codec.h"
#include "codec/video_coder.h"

namespace relievo {
namespace {

const VideoFormat kFormat{.width = 160, .height = 96};

/// What the environment says until the end of the test.
class Environment {
 public:
  Environment(const char* name, const std::string& value) : name_(name) { setenv(name, value.c_str(), 1); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;
  ~Environment() { unsetenv(name_); }

 private:
  const char* name_;
};

/// The luma of one slope that moves, and no colour.
struct Picture {
  explicit Picture(int number) : luma(160 * 96), chroma(80 * 48, 128) {
    for (int y = 0; y < kFormat.height; ++y)
      for (int x = 0; x < kFormat.width; ++x)
        luma[static_cast<std::size_t>(y * kFormat.width + x)] =
            static_cast<std::uint8_t>(128 + 100 * std::sin(0.05 * (x + y) + 0.2 * number));
  }
  VideoView view() const {
    return {.planes = {luma.data(), chroma.data(), chroma.data()}, .stride_bytes = {160, 80, 80}};
  }
  /// Root mean square, in parts of the range.
  double error(const VideoView& other) const {
    double squares = 0;
    for (int y = 0; y < kFormat.height; ++y)
      for (int x = 0; x < kFormat.width; ++x) {
        const double other_luma = other.planes[0][y * other.stride_bytes[0] + x];
        const double d = luma[static_cast<std::size_t>(y * kFormat.width + x)] - other_luma;
        squares += d * d;
      }
    return std::sqrt(squares / static_cast<double>(luma.size())) / 255;
  }

  std::vector<std::uint8_t> luma, chroma;
};

struct Went {
  std::vector<bool> keys;
  std::vector<std::string> notices;  // those that say something
};

/// Pictures one after the other through encoder and decoder, each of which must come back; the third has
/// another quality where `other_quality`, the fifth is asked for as a key picture.
Went go(VideoEncoderKind kind, double other_quality = 23) {
  Went went;
  auto encoder = VideoEncoder::create(kFormat, VideoSpeed::kSuperfast, kind);
  auto decoder = VideoDecoder::create();
  EXPECT_TRUE(encoder.ok() && decoder.ok());
  if (!encoder || !decoder) return went;
  for (int number = 0; number < 8; ++number) {
    const Picture picture(number);
    Bytes unit;
    const auto key = encoder->encode(
        picture.view(), {.rate_factor = number < 2 ? 23 : other_quality, .key = number == 4}, unit);
    EXPECT_TRUE(key.ok()) << number << ": " << key.error().message;
    if (!key) return went;
    went.keys.push_back(*key);
    const auto back = decoder->decode(unit, kFormat);
    EXPECT_TRUE(back.ok()) << number << ": " << back.error().message;
    if (!back) return went;
    EXPECT_LT(picture.error(*back), 0.05) << number;
    if (std::string notice = encoder->take_notice(); !notice.empty()) went.notices.push_back(notice);
  }
  return went;
}

void expect_one_notice(const Went& went, const std::string& why) {
  ASSERT_EQ(went.notices.size(), 1U);
  for (const std::string& part : {std::string("h264_v4l2m2m"), std::string("x264"), why})
    EXPECT_NE(went.notices[0].find(part), std::string::npos) << went.notices[0];
}

/// What stands in for the hardware works, or the other tests here say nothing.
TEST(VideoFallback, WhatDoesNotFailStays) {
  const Went went = go(VideoEncoderKind::kV4l2m2m);
  EXPECT_EQ(went.keys, (std::vector<bool>{true, false, false, false, true, false, false, false}));
  EXPECT_TRUE(went.notices.empty());
  EXPECT_EQ(chosen_video_encoder().kind, VideoEncoderKind::kV4l2m2m);
}

TEST(VideoFallback, X264GoesOnWhereTheHardwareFails) {
  const Environment takes("FLAKY_H264_PICTURES", "3");
  for (const VideoEncoderKind kind : {VideoEncoderKind::kAuto, VideoEncoderKind::kV4l2m2m}) {
    const Went went = go(kind);
    EXPECT_EQ(went.keys, (std::vector<bool>{true, false, false, true, true, false, false, false}));
    expect_one_notice(went, "nput/output error");
  }
}

TEST(VideoFallback, X264GoesOnWhereTheHardwareDoesNotOpenForAnotherQuality) {
  for (int opened = 1;; ++opened) {  // before and by this
    const Environment so_many("FLAKY_H264_OPENS", std::to_string(opened));
    if (VideoEncoder::create(kFormat, VideoSpeed::kSuperfast, VideoEncoderKind::kV4l2m2m)) {
      const Environment one_more("FLAKY_H264_OPENS", std::to_string(opened + 1));
      const Went went = go(VideoEncoderKind::kV4l2m2m, 30);
      EXPECT_EQ(went.keys, (std::vector<bool>{true, false, true, false, true, false, false, false}));
      return expect_one_notice(went, "does not open");
    }
  }
}

/// Whoever joins waits for it.
TEST(VideoFallback, X264GoesOnWhereTheHardwareGivesNoKeyPictureThatWasAskedFor) {
  const Environment keys("FLAKY_H264_KEYS", "0");
  const Went went = go(VideoEncoderKind::kV4l2m2m);
  EXPECT_EQ(went.keys, (std::vector<bool>{true, false, false, false, true, false, false, false}));
  expect_one_notice(went, "key picture");
}

/// Named and not there from the first on: an error, as it was.
TEST(VideoFallback, OneThatNeverOpenedIsStillAnError) {
  const Environment none("FLAKY_H264_OPENS", "0");
  EXPECT_FALSE(VideoEncoder::create(kFormat, VideoSpeed::kSuperfast, VideoEncoderKind::kV4l2m2m).ok());
}

/// Sections name the picture they build on: they go on fitting together.
TEST(VideoFallback, TexturesGoOn) {
  const Environment takes("FLAKY_H264_PICTURES", "3");
  auto encoder = make_texture_encoder(TextureCodec::kH264);
  auto decoder = make_texture_decoder(TextureCodec::kH264);
  Image8 out;
  int notices = 0;
  for (int number = 0; number < 8; ++number) {
    const Picture picture(number);
    const View8 view{picture.luma.data(), 160, 96, 1, 160};
    Bytes section;
    const auto alone = encoder->encode(view, {.encoder = VideoEncoderKind::kV4l2m2m}, section);
    ASSERT_TRUE(alone.ok()) << alone.error().message;
    EXPECT_EQ(*alone, number == 0 || number == 3);
    EXPECT_TRUE(decoder->decode(section, 160, 96, out).ok()) << number;
    notices += encoder->take_notice().empty() ? 0 : 1;
  }
  EXPECT_EQ(notices, 1);
}

}  // namespace
}  // namespace relievo
