// SPDX-License-Identifier: Apache-2.0
// H.264 there and back, in each format, and what is no such stream.
#include "codec/video_coder.h"

#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/avcodec.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace relievo {
namespace {

/// A soft pattern that moves one pixel to the right with each picture.
struct Film {
  VideoFormat format;
  std::vector<std::vector<std::uint16_t>> planes;
  std::vector<std::vector<std::uint8_t>> bytes;

  int width(std::size_t plane) const { return plane == 0 ? format.width : format.width / 2; }
  int height(std::size_t plane) const { return plane == 0 ? format.height : format.height / 2; }
  int peak() const { return (1 << format.bits) - 1; }

  VideoView picture(int number) {
    const std::size_t count = format.sampling == VideoSampling::kLuma ? 1 : 3;
    planes.assign(count, {});
    bytes.assign(count, {});
    VideoView view;
    for (std::size_t p = 0; p < count; ++p) {
      for (int y = 0; y < height(p); ++y)
        for (int x = 0; x < width(p); ++x) {
          const double phase = static_cast<double>(p) + 0.1 * (x - number) + 0.07 * y;
          planes[p].push_back(
              static_cast<std::uint16_t>(std::lround(peak() * (0.5 + 0.49 * std::sin(phase)))));
        }
      const std::size_t sample = format.bits > 8 ? 2 : 1;
      bytes[p].resize(planes[p].size() * sample);
      for (std::size_t i = 0; i < planes[p].size(); ++i)
        std::memcpy(&bytes[p][i * sample], &planes[p][i], sample);
      view.planes[p] = bytes[p].data();
      view.stride_bytes[p] = static_cast<std::ptrdiff_t>(sample) * width(p);
    }
    return view;
  }

  /// Root mean square difference to the last picture, in parts of the range.
  double error(const VideoView& view) const {
    double squares = 0;
    double count = 0;
    for (std::size_t p = 0; p < planes.size(); ++p)
      for (int y = 0; y < height(p); ++y)
        for (int x = 0; x < width(p); ++x) {
          std::uint16_t sample = 0;
          const std::size_t size = format.bits > 8 ? 2 : 1;
          std::memcpy(&sample, view.planes[p] + y * view.stride_bytes[p] + x * static_cast<int>(size), size);
          const double d =
              static_cast<double>(sample) - planes[p][static_cast<std::size_t>(y * width(p) + x)];
          squares += d * d;
          ++count;
        }
    return std::sqrt(squares / count) / peak();
  }
};

VideoEncoder encoder_of(const VideoFormat& format) {
  auto encoder = VideoEncoder::create(format);
  EXPECT_TRUE(encoder.ok()) << encoder.error().message;
  return std::move(*encoder);
}
VideoDecoder decoder() {
  auto made = VideoDecoder::create();
  EXPECT_TRUE(made.ok()) << made.error().message;
  return std::move(*made);
}

const VideoFormat kColour{.width = 80, .height = 50};

/// The film's last picture, as what it is.
void expect_comes_back(const Bytes& unit, bool key, const Film& film, VideoDecoder& decode) {
  const auto said = check_access_unit(unit, film.format);
  ASSERT_TRUE(said.ok()) << said.error().message;
  EXPECT_EQ(*said, key);
  const auto view = decode.decode(unit, film.format);
  ASSERT_TRUE(view.ok()) << view.error().message;
  EXPECT_LT(film.error(*view), 0.02);
}

class VideoFormats : public testing::TestWithParam<VideoFormat> {};

TEST_P(VideoFormats, PicturesComeBackAtOnceAndInOrder) {
  Film film{GetParam()};
  VideoEncoder encoder = encoder_of(film.format);
  VideoDecoder decode = decoder();
  for (int number = 0; number < 12; ++number) {
    Bytes unit;
    const auto key = encoder.encode(film.picture(number), {.rate_factor = 15, .key = number == 7}, unit);
    ASSERT_TRUE(key.ok()) << key.error().message;
    EXPECT_EQ(*key, number == 0 || number == 7);
    SCOPED_TRACE(number);
    ASSERT_NO_FATAL_FAILURE(expect_comes_back(unit, *key, film, decode));
  }
}

INSTANTIATE_TEST_SUITE_P(Some, VideoFormats,
                         testing::Values(VideoFormat{80, 50}, VideoFormat{64, 48, VideoSampling::k420, 10},
                                         VideoFormat{81, 47, VideoSampling::kLuma},
                                         VideoFormat{90, 61, VideoSampling::kLuma, 10}),
                         [](const auto& test) {
                           return std::string(test.param.sampling == VideoSampling::kLuma ? "luma"
                                                                                          : "colour") +
                                  std::to_string(test.param.bits);
                         });

TEST(VideoCoder, TenBitsTellMoreThanEightCould) {
  Film film{{.width = 96, .height = 64, .sampling = VideoSampling::kLuma, .bits = 10}};
  VideoEncoder encoder = encoder_of(film.format);
  VideoDecoder decode = decoder();
  Bytes unit;
  ASSERT_TRUE(encoder.encode(film.picture(0), {.rate_factor = 1}, unit).ok());
  const auto view = decode.decode(unit, film.format);
  ASSERT_TRUE(view.ok());
  const double of_eight_bits = 1 / 255.0 / std::sqrt(12);  // their rounding alone, coded without loss
  EXPECT_LT(film.error(*view), 0.8 * of_eight_bits);
}

TEST(VideoCoder, TheRateFactorCountsFromPictureToPicture) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  Bytes fine;
  Bytes coarse;
  ASSERT_TRUE(encoder.encode(film.picture(0), {.rate_factor = 10, .key = true}, fine).ok());
  ASSERT_TRUE(encoder.encode(film.picture(0), {.rate_factor = 40, .key = true}, coarse).ok());
  EXPECT_LT(2 * coarse.size(), fine.size());
}

TEST(VideoCoder, TheSamePicturesGiveTheSameBytes) {
  Bytes all[2];
  for (Bytes& bytes : all) {
    Film film{kColour};
    VideoEncoder encoder = encoder_of(kColour);
    for (int number = 0; number < 4; ++number)
      ASSERT_TRUE(encoder.encode(film.picture(number), {}, bytes).ok());
  }
  EXPECT_EQ(all[0], all[1]);
}

TEST(VideoCoder, SlicesAreOnePictureAndTheSameBytesEachTime) {
  Film film{{.width = 320, .height = 192}};
  const auto slices_of = [](const Bytes& unit) {
    int count = 0;
    for (std::size_t i = 0; i + 3 < unit.size(); ++i)
      count += unit[i] == 0 && unit[i + 1] == 0 && unit[i + 2] == 1 &&
               ((unit[i + 3] & 31) == 1 || (unit[i + 3] & 31) == 5);
    return count;
  };
  auto encoder = VideoEncoder::create(film.format, VideoSpeed::kUltrafast, VideoEncoderKind::kX264, 3);
  auto again = VideoEncoder::create(film.format, VideoSpeed::kUltrafast, VideoEncoderKind::kX264, 3);
  ASSERT_TRUE(encoder.ok() && again.ok());
  VideoDecoder decode = decoder();
  for (int number = 0; number < 8; ++number) {
    Bytes unit, second;
    const VideoView picture = film.picture(number);
    const auto key = encoder->encode(picture, {.rate_factor = 15, .key = number == 5}, unit);
    ASSERT_TRUE(key.ok() && again->encode(picture, {.rate_factor = 15, .key = number == 5}, second).ok());
    EXPECT_EQ(unit, second);
    EXPECT_EQ(slices_of(unit), 3);
    EXPECT_EQ(*key, number == 0 || number == 5);
    SCOPED_TRACE(number);
    ASSERT_NO_FATAL_FAILURE(expect_comes_back(unit, *key, film, decode));
  }
}

TEST_P(VideoFormats, WhatIsPutIntoTheEncodersPlanesIsCodedAsACopyIs) {
  Film film{GetParam()};
  VideoEncoder copies = encoder_of(film.format), in_place = encoder_of(film.format);
  const std::uint8_t* first = nullptr;
  for (int number = 0; number < 4; ++number) {
    const VideoView picture = film.picture(number);
    const auto to = in_place.next_picture();
    ASSERT_TRUE(to.ok()) << to.error().message;
    if (first == nullptr) first = to->planes[0];
    EXPECT_EQ(to->planes[0], first) << "the encoder keeps pictures, so that each is in new memory";
    for (std::size_t p = 0; p < film.bytes.size(); ++p)
      for (int y = 0; y < film.height(p); ++y)
        std::copy_n(picture.planes[p] + y * picture.stride_bytes[p], picture.stride_bytes[p],
                    to->planes[p] + y * to->stride_bytes[p]);
    Bytes copied, placed;
    ASSERT_TRUE(copies.encode(picture, {}, copied).ok());
    ASSERT_TRUE(in_place.encode({}, placed).ok());
    EXPECT_EQ(copied, placed) << number;
  }
}

TEST(VideoCoder, APictureIsNotDecodedWithoutTheOneItBuildsOn) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  Bytes key;
  Bytes next;
  ASSERT_TRUE(encoder.encode(film.picture(0), {}, key).ok());
  ASSERT_TRUE(encoder.encode(film.picture(1), {}, next).ok());
  VideoDecoder decode = decoder();
  EXPECT_FALSE(decode.decode(next, kColour).ok());
  EXPECT_TRUE(decode.decode(key, kColour).ok());
  EXPECT_FALSE(decode.decode({}, kColour).ok());
  EXPECT_TRUE(decode.decode(next, kColour).ok()) << "what is refused before the decoder does not hurt it";
}

TEST(VideoCoder, PicturesOfAnotherFormatAreRefusedBeforeTheyAreDecoded) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  Bytes unit;
  ASSERT_TRUE(encoder.encode(film.picture(0), {}, unit).ok());
  VideoDecoder decode = decoder();
  for (const VideoFormat& other :
       {VideoFormat{78, 50}, VideoFormat{80, 48}, VideoFormat{80, 50, VideoSampling::kLuma},
        VideoFormat{80, 50, VideoSampling::k420, 10}, VideoFormat{160, 100}})
    EXPECT_FALSE(decode.decode(unit, other).ok());
  EXPECT_TRUE(decode.decode(unit, kColour).ok());
}

TEST(VideoCoder, WhatIsNoFormatIsRefused) {
  for (const VideoFormat& format :
       {VideoFormat{0, 0}, VideoFormat{14, 64}, VideoFormat{81, 50}, VideoFormat{80, 51},
        VideoFormat{8194, 16}, VideoFormat{8192, 8192}, VideoFormat{80, 50, VideoSampling::k420, 9}})
    EXPECT_FALSE(VideoEncoder::create(format).ok());
}

/// As any decoder reads it that knows nothing of us.
TEST(VideoCoder, TheStreamSaysItsRangeAndColours) {
  for (const VideoSampling sampling : {VideoSampling::k420, VideoSampling::kLuma}) {
    Film film{.format = {.width = 80, .height = 50, .sampling = sampling}, .planes = {}, .bytes = {}};
    VideoEncoder encoder = encoder_of(film.format);
    Bytes unit;
    ASSERT_TRUE(encoder.encode(film.picture(0), {}, unit).ok());
    unit.resize(unit.size() + AV_INPUT_BUFFER_PADDING_SIZE);
    AVCodecContext* codec = avcodec_alloc_context3(avcodec_find_decoder(AV_CODEC_ID_H264));
    AVPacket* packet = av_packet_alloc();
    AVFrame* picture = av_frame_alloc();
    packet->data = unit.data();
    packet->size = static_cast<int>(unit.size()) - AV_INPUT_BUFFER_PADDING_SIZE;
    codec->flags |= AV_CODEC_FLAG_LOW_DELAY;
    EXPECT_EQ(avcodec_open2(codec, nullptr, nullptr), 0);
    EXPECT_EQ(avcodec_send_packet(codec, packet), 0);
    EXPECT_EQ(avcodec_receive_frame(codec, picture), 0);
    EXPECT_EQ(picture->color_range, AVCOL_RANGE_JPEG);
    EXPECT_EQ(picture->color_primaries, AVCOL_PRI_BT709);
    EXPECT_EQ(picture->color_trc, AVCOL_TRC_IEC61966_2_1);
    if (sampling == VideoSampling::k420) {
      EXPECT_EQ(picture->colorspace, AVCOL_SPC_SMPTE170M);
      EXPECT_EQ(picture->chroma_location, AVCHROMA_LOC_CENTER);
    }
    av_frame_free(&picture);
    av_packet_free(&packet);
    avcodec_free_context(&codec);
  }
}

TEST(VideoUnit, TwoPicturesInOneAreRefused) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  Bytes units;
  ASSERT_TRUE(encoder.encode(film.picture(0), {}, units).ok());
  ASSERT_TRUE(check_access_unit(units, kColour).ok());
  ASSERT_TRUE(encoder.encode(film.picture(1), {}, units).ok());
  EXPECT_FALSE(check_access_unit(units, kColour).ok());
}

TEST(VideoUnit, ZerosMayFollow) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  VideoDecoder decode = decoder();
  Bytes unit;
  ASSERT_TRUE(encoder.encode(film.picture(0), {}, unit).ok());
  unit.resize(unit.size() + 1000);
  EXPECT_TRUE(decode.decode(unit, kColour).ok());
}

/// Every byte of key and delta picture changed in turn: refused or a picture, and the next key picture is
/// one.
TEST(VideoCoderHostile, DamageNeverBreaksTheDecoder) {
  Film film{kColour};
  VideoEncoder encoder = encoder_of(kColour);
  Bytes key;
  Bytes next;
  ASSERT_TRUE(encoder.encode(film.picture(0), {}, key).ok());
  ASSERT_TRUE(encoder.encode(film.picture(1), {}, next).ok());
  VideoDecoder decode = decoder();
  int refused = 0;
  for (std::size_t at = 0; at < key.size() + next.size(); ++at) {
    for (const int change : {0x01, 0x80, 0xff}) {
      Bytes bad_key = key;
      Bytes bad_next = next;
      std::uint8_t& byte = at < key.size() ? bad_key[at] : bad_next[at - key.size()];
      byte = static_cast<std::uint8_t>(byte ^ change);
      if (!decode.decode(bad_key, kColour) || !decode.decode(bad_next, kColour)) ++refused;
      const auto again = decode.decode(key, kColour);
      ASSERT_TRUE(again.ok()) << again.error().message << " after a change at " << at;
    }
  }
  EXPECT_GT(refused, 100);
  for (std::size_t size = 0; size < key.size(); ++size)
    if (!decode.decode(std::span(key).first(size), kColour)) ++refused;
  EXPECT_TRUE(decode.decode(key, kColour).ok());
}

/// On any machine: pictures come, from x264 where no hardware encoder opens, and then it is said why.
TEST(VideoEncoders, AutoFallsBackAndSaysWhy) {
  const ChosenVideoEncoder& chosen = chosen_video_encoder();
  EXPECT_NE(chosen.kind, VideoEncoderKind::kAuto);
  EXPECT_EQ(chosen.kind == VideoEncoderKind::kX264, !chosen.why_not_hardware.empty());
  if (chosen.kind == VideoEncoderKind::kX264) {
    for (const char* name : {"nvenc", "vaapi", "v4l2m2m"})
      EXPECT_NE(chosen.why_not_hardware.find(name), std::string::npos) << chosen.why_not_hardware;
  }
  Film film{.format = {.width = 160, .height = 96}, .planes = {}, .bytes = {}};
  auto encoder = VideoEncoder::create(film.format, VideoSpeed::kSuperfast, VideoEncoderKind::kAuto);
  ASSERT_TRUE(encoder.ok()) << encoder.error().message;
  Bytes unit;
  const auto key = encoder->encode(film.picture(0), {}, unit);
  ASSERT_TRUE(key.ok()) << key.error().message;
  EXPECT_TRUE(*key);
  auto back = decoder();
  EXPECT_TRUE(back.decode(unit, film.format).ok());
}

/// One that is asked for by name and is not there is an error that names it, never another one.
TEST(VideoEncoders, AForcedOneThatIsMissingIsAnError) {
  for (const VideoEncoderKind kind :
       {VideoEncoderKind::kNvenc, VideoEncoderKind::kVaapi, VideoEncoderKind::kV4l2m2m}) {
    testing::internal::CaptureStderr();
    const auto encoder = VideoEncoder::create({.width = 160, .height = 96}, VideoSpeed::kSuperfast, kind);
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "the error says it";
    if (encoder.ok()) continue;  // this machine has it
    EXPECT_NE(encoder.error().message.find(video_encoder_name(kind)), std::string::npos);
    EXPECT_NE(encoder.error().message.find("--texture-encoder"), std::string::npos);
  }
  EXPECT_FALSE(video_encoder_named("quicksync"));
  EXPECT_EQ(video_encoder_named("vaapi"), VideoEncoderKind::kVaapi);
}

}  // namespace
}  // namespace relievo
