// SPDX-License-Identifier: Apache-2.0
// Every texture codec there and back, by itself and in frames, where pictures build on those before.
#include "codec/texture_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "codec/texture_png.h"
#include "codec/texture_webp.h"
#include "tests/support/make_grid.h"
#include "tests/support/make_surface.h"

namespace relievo {
namespace {

constexpr TextureCodec kAll[] = {TextureCodec::kJpeg, TextureCodec::kWebp, TextureCodec::kPng,
                                 TextureCodec::kH264};

/// The picture `number` of a film: a pattern that moves.
Image8 film(int number, int width = 96, int height = 64, int channels = 3) {
  Image8 image(width, height, channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image.row(y)[x * channels + c] = static_cast<std::uint8_t>(
            128 + 100 * std::sin(0.05 * (x - 2 * number) + c) * std::cos(0.04 * y - c));
  return image;
}

double psnr(const Image8& a, const Image8& rgb) {
  double squares = 0;
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x)
      for (int c = 0; c < 3; ++c) {
        const double wanted = a.row(y)[x * a.channels() + std::min(c, a.channels() - 1)];
        squares += std::pow(wanted - rgb.row(y)[x * 3 + c], 2);
      }
  return 10 * std::log10(255.0 * 255 * 3 * a.width() * a.height() / squares);
}

class Textures : public testing::TestWithParam<TextureCodec> {
 protected:
  void SetUp() override {
    Bytes unused;
    if (!make_texture_encoder(GetParam())->encode(film(0).view(), {}, unused))
      GTEST_SKIP() << "this build has no " << texture_codec_name(GetParam());
  }
};

TEST_P(Textures, ComeBackInEverySizeAndInGrey) {
  for (const auto& [width, height] : {std::pair{96, 64}, {101, 57}, {16, 16}, {1, 1}, {7, 40}, {333, 5}})
    for (const int channels : {3, 1}) {
      const auto encoder = make_texture_encoder(GetParam());
      const auto decoder = make_texture_decoder(GetParam());
      Bytes section;
      const Image8 picture = film(0, width, height, channels);
      const auto alone = encoder->encode(picture.view(), {.quality = 90}, section);
      ASSERT_TRUE(alone.ok()) << alone.error().message;
      EXPECT_TRUE(*alone);
      EXPECT_TRUE(texture_is_key(GetParam(), section));
      Image8 back;
      const Status done = decoder->decode(section, static_cast<std::uint32_t>(width),
                                          static_cast<std::uint32_t>(height), back);
      ASSERT_TRUE(done.ok()) << done.error().message;
      ASSERT_EQ(back.width(), width);
      ASSERT_EQ(back.height(), height);
      ASSERT_EQ(back.channels(), 3);
      EXPECT_GT(psnr(picture, back), 30) << width << "x" << height << "x" << channels;
    }
}

TEST_P(Textures, AnotherSizeThanDeclaredIsRefused) {
  Bytes section;
  ASSERT_TRUE(make_texture_encoder(GetParam())->encode(film(0).view(), {}, section).ok());
  Image8 back;
  for (const auto& [width, height] :
       {std::pair{96U, 66U}, {94U, 64U}, {192U, 128U}, {~0U, 1U}, {70'000U, 70'000U}})
    EXPECT_FALSE(make_texture_decoder(GetParam())->decode(section, width, height, back).ok());
  EXPECT_TRUE(make_texture_decoder(GetParam())->decode(section, 96, 64, back).ok());
}

TEST_P(Textures, APictureOfOneColourIsNotRefusedAsTooSmall) {
  Frame3D frame;
  frame.texture = Image8(640, 480, 3);
  EncodeOptions options;
  options.texture = GetParam();
  const auto bytes = encode_frame(frame, options);
  ASSERT_TRUE(bytes.ok()) << bytes.error().message;
  const auto back = decode_frame(*bytes);
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_GT(psnr(frame.texture, back->texture), 40);
}

TEST_P(Textures, MoreQualityMeansMoreBytesAndLessError) {
  double before = 0;
  std::size_t bytes = 0;
  for (const int quality : {20, 60, 95}) {
    Bytes section;
    ASSERT_TRUE(make_texture_encoder(GetParam())->encode(film(0).view(), {.quality = quality}, section).ok());
    Image8 back;
    ASSERT_TRUE(make_texture_decoder(GetParam())->decode(section, 96, 64, back).ok());
    if (GetParam() == TextureCodec::kPng) {
      EXPECT_EQ(std::memcmp(back.data(), film(0).data(), back.size()), 0) << "it is lossless";
      continue;
    }
    EXPECT_GT(psnr(film(0), back), before);
    EXPECT_GT(section.size(), bytes);
    before = psnr(film(0), back);
    bytes = section.size();
  }
}

/// Bytes changed, every length cut to: an error or a picture of that size, never worse.
TEST_P(Textures, DamagedOnesAreErrorsOrPictures) {
  Bytes section;
  ASSERT_TRUE(make_texture_encoder(GetParam())->encode(film(0).view(), {.quality = 50}, section).ok());
  const auto decoder = make_texture_decoder(GetParam());
  Image8 back;
  test::Random random(3);
  int refused = 0;
  const std::size_t step = section.size() / 500 + 1;
  for (std::size_t at = 0; at < section.size(); at += at < 100 ? 1 : step) {
    Bytes damaged = section;
    damaged[at] = static_cast<std::uint8_t>(damaged[at] ^ (1 + random.below(255)));
    if (!decoder->decode(damaged, 96, 64, back)) ++refused;
    if (!decoder->decode(std::span(section).first(at), 96, 64, back)) ++refused;
    ASSERT_EQ(back.empty() ? 96 : back.width(), 96);
  }
  EXPECT_GT(refused, 20);
  const Status sound = decoder->decode(section, 96, 64, back);
  EXPECT_TRUE(sound.ok()) << sound.error().message;
}

TEST_P(Textures, AreNamed) {
  const std::string name = texture_codec_name(GetParam());
  EXPECT_EQ(texture_codec_named(name), GetParam());
  EXPECT_NE(texture_codec_names().find(name), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(All, Textures, testing::ValuesIn(kAll),
                         [](const auto& test) { return texture_codec_name(test.param); });

TEST(TextureCodecs, OthersAreNone) {
  EXPECT_EQ(make_texture_encoder(TextureCodec::kNone), nullptr);
  EXPECT_EQ(make_texture_decoder(static_cast<TextureCodec>(77)), nullptr);
  EXPECT_EQ(texture_codec_named("none"), std::nullopt);
  EXPECT_EQ(texture_codec_name(static_cast<TextureCodec>(77)), "77");
}

// ---------------------------------------------------------------- pictures that build on others

class VideoTexture : public testing::Test {
 protected:
  void SetUp() override {
    Bytes unused;
    if (!make_texture_encoder(TextureCodec::kH264)->encode(film(0).view(), {}, unused))
      GTEST_SKIP() << "this build has no H.264";
  }

  /// A stream of grid and H.264 frames.
  Bytes next(int number, bool with_surface = true) {
    Frame3D frame;
    if (with_surface) frame = test::grid_frame({.seed = static_cast<std::uint64_t>(number) + 1});
    frame.number = static_cast<std::uint64_t>(number);
    frame.texture = film(number);
    const auto bytes = encoder_.encode(frame, options_);
    EXPECT_TRUE(bytes.ok()) << bytes.error().message;
    return *bytes;
  }

  FrameEncoder encoder_{test::grid_rig({}), test::grid_pattern({})};
  EncodeOptions options_{.geometry = GeometryCodec::kGrid,
                         .texture = TextureCodec::kH264,
                         .texture_quality = 90,
                         .key_interval = 5};
};

TEST_F(VideoTexture, FramesDecodeInOrderAndKeyFramesAlone) {
  FrameDecoder decoder;
  for (int number = 0; number < 12; ++number) {
    const Bytes bytes = next(number);
    EXPECT_EQ(is_key_frame(bytes), number % 5 == 0) << number;
    EXPECT_EQ(decode_frame(bytes).ok(), number % 5 == 0) << number;
    ASSERT_TRUE(decoder.can_decode(bytes));
    const auto frame = decoder.decode(bytes);
    ASSERT_TRUE(frame.ok()) << frame.error().message;
    EXPECT_GT(psnr(film(number), frame->texture), 33) << number;
    EXPECT_GT(frame->surface.positions.size(), 1000u);
  }
}

/// Of the sequence parameter set in an H.264 section: 66 Baseline, which x264's quickest preset makes, 100
/// High.
int profile_of(const Bytes& section) {
  constexpr std::array<std::uint8_t, 4> kSequence{0, 0, 1, 0x67};
  const auto at = std::search(section.begin(), section.end(), kSequence.begin(), kSequence.end());
  return section.end() - at > 4 ? at[4] : -1;
}

TEST_F(VideoTexture, ManyPixelsASecondAreCodedTheQuickestWay) {
  struct Case {
    int width, height;
    double rate_hz;
    int profile;
  };
  for (const Case& c :
       {Case{1920, 1080, 0, 100}, {1920, 1080, 30, 100}, {1920, 1080, 60, 66}, {96, 64, 60, 100}}) {
    const Image8 picture = film(0, c.width, c.height);
    Bytes section;
    ASSERT_TRUE(
        make_texture_encoder(TextureCodec::kH264)
            ->encode(picture.view(),
                     {.quality = 90, .key = true, .encoder = VideoEncoderKind::kX264, .rate_hz = c.rate_hz},
                     section)
            .ok());
    EXPECT_EQ(profile_of(section), c.profile) << c.width << " at " << c.rate_hz;
    Image8 back;
    ASSERT_TRUE(
        make_texture_decoder(TextureCodec::kH264)
            ->decode(section, static_cast<std::uint32_t>(c.width), static_cast<std::uint32_t>(c.height), back)
            .ok());
    EXPECT_GT(psnr(picture, back), 33);
  }
}

TEST_F(VideoTexture, AGapIsNoticedAndMendedByTheNextKeyFrame) {
  FrameDecoder decoder;
  std::vector<bool> shown;
  for (int number = 0; number < 12; ++number) {
    const Bytes bytes = next(number);
    if (number == 2) continue;  // lost
    const bool can = decoder.can_decode(bytes);
    EXPECT_EQ(decoder.decode(bytes).ok(), can) << number;
    shown.push_back(can);
  }
  EXPECT_EQ(shown, (std::vector<bool>{1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 1}));
}

TEST_F(VideoTexture, AGapOfAWholeIntervalIsNoticed) {
  FrameDecoder decoder;
  ASSERT_TRUE(decoder.decode(next(0)).ok());
  for (int number = 1; number < 6; ++number) next(number);  // among them the next key frame
  EXPECT_FALSE(decoder.can_decode(next(6)));
}

TEST_F(VideoTexture, AFrameIsNotDecodedTwice) {
  FrameDecoder decoder;
  ASSERT_TRUE(decoder.decode(next(0)).ok());
  const Bytes bytes = next(1);
  ASSERT_TRUE(decoder.decode(bytes).ok());
  EXPECT_FALSE(decoder.can_decode(bytes));
}

TEST_F(VideoTexture, FramesThatNobodySeesAreRemembered) {
  FrameDecoder decoder;
  for (int number = 0; number < 4; ++number) ASSERT_TRUE(decoder.remember(next(number)).ok());
  const auto frame = decoder.decode(next(4));
  ASSERT_TRUE(frame.ok()) << frame.error().message;
  EXPECT_GT(psnr(film(4), frame->texture), 33);
}

TEST_F(VideoTexture, AKeyFrameComesWhenAskedFor) {
  next(0);
  EXPECT_FALSE(is_key_frame(next(1)));
  encoder_.request_key_frame();
  const Bytes bytes = next(2);
  EXPECT_TRUE(is_key_frame(bytes));
  EXPECT_TRUE(decode_frame(bytes).ok());
}

TEST_F(VideoTexture, StreamsWithoutSurfacesAreStreams) {
  FrameDecoder decoder;
  for (int number = 0; number < 7; ++number) {
    const Bytes bytes = next(number, false);
    EXPECT_EQ(is_key_frame(bytes), number % 5 == 0);
    EXPECT_TRUE(decoder.decode(bytes).ok()) << number;
  }
}

TEST_F(VideoTexture, AnotherSizeOrCodecBeginsAnew) {
  next(0);
  next(1);
  Frame3D frame;
  frame.texture = film(2, 80, 80);
  const auto larger = encoder_.encode(frame, options_);
  ASSERT_TRUE(larger.ok());
  EXPECT_TRUE(is_key_frame(*larger));
  options_.texture = TextureCodec::kJpeg;
  next(3);
  options_.texture = TextureCodec::kH264;
  const Bytes back = next(4);
  FrameDecoder decoder;
  EXPECT_TRUE(is_key_frame(back)) << "nothing to build on, neither geometry nor texture";
  EXPECT_TRUE(decoder.decode(back).ok());
}

TEST_F(VideoTexture, AFrameThatLiesAboutItsKeyIsRefused) {
  Bytes key = next(0);
  Bytes delta = next(1);
  key[5] = 0;
  delta[5] = 1;
  EXPECT_FALSE(FrameDecoder().decode(key).ok());
  encoder_.request_key_frame();
  FrameDecoder decoder;
  ASSERT_TRUE(decoder.decode(next(2)).ok());
  EXPECT_FALSE(decoder.decode(delta).ok());
}

TEST_F(VideoTexture, AFrameWithoutATextureMayComeBetween) {
  FrameDecoder decoder;
  ASSERT_TRUE(decoder.decode(next(0)).ok());
  Frame3D bare = test::grid_frame({});
  const auto between = encoder_.encode(bare, options_);
  ASSERT_TRUE(between.ok());
  EXPECT_TRUE(decoder.decode(*between).ok());
  const auto after = decoder.decode(next(1));
  EXPECT_TRUE(after.ok()) << after.error().message;
}

TEST_F(VideoTexture, DeltasOfMeshesAreFramesToo) {
  options_.geometry = GeometryCodec::kDracoMesh;
  FrameDecoder decoder;
  for (int number = 0; number < 3; ++number) {
    const Bytes bytes = next(number);
    EXPECT_EQ(is_key_frame(bytes), number == 0);
    EXPECT_TRUE(decoder.decode(bytes).ok());
  }
}

// ---------------------------------------------------------------- what stills may be

TEST(PngTexture, KindsThatWouldBeConvertedAreRefused) {
  Bytes png;
  ASSERT_TRUE(append_png(film(0).view(), PngEffort::kSmall, png).ok());
  ASSERT_TRUE(decode_png(png, 96, 64).ok());
  png[24] = 16;  // bits a sample, with the chunk's CRC now wrong as well
  EXPECT_FALSE(decode_png(png, 96, 64).ok());
}

TEST(WebpTexture, CutOnesAreRefused) {
  Bytes webp;
  ASSERT_TRUE(append_webp(film(0).view(), 80, webp).ok());
  for (std::size_t size = 0; size + 1 < webp.size(); ++size)
    ASSERT_FALSE(decode_webp(std::span(webp).first(size), 96, 64).ok()) << size;
}

}  // namespace
}  // namespace relievo
