// SPDX-License-Identifier: Apache-2.0
#include "codec/video_coder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace relievo {
namespace {

template <auto Free>
struct FreeWith {
  template <typename T>
  void operator()(T* pointer) const {
    Free(&pointer);
  }
};
using Codec = std::unique_ptr<AVCodecContext, FreeWith<avcodec_free_context>>;
using Picture = std::unique_ptr<AVFrame, FreeWith<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, FreeWith<av_packet_free>>;

constexpr double kFinest = 1;  // 0 is another profile, lossless
constexpr double kCoarsest = 51;

std::string text_of(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

AVPixelFormat pixel_format(const VideoFormat& format) {
  if (format.sampling == VideoSampling::kLuma) return format.bits == 8 ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_GRAY10;
  return format.bits == 8 ? AV_PIX_FMT_YUV420P : AV_PIX_FMT_YUV420P10;
}

/// What libavcodec's decoder may call it: full range has names of its own, and it adds chroma to luma.
bool is_format(int found, const VideoFormat& format) {
  if (found == pixel_format(format)) return true;
  return format.bits == 8 ? found == AV_PIX_FMT_YUVJ420P || found == AV_PIX_FMT_YUV420P
                          : found == AV_PIX_FMT_YUV420P10;
}

const char* preset(VideoSpeed speed) {
  switch (speed) {
    case VideoSpeed::kUltrafast:
      return "ultrafast";
    case VideoSpeed::kSuperfast:
      return "superfast";
    case VideoSpeed::kVeryfast:
      return "veryfast";
  }
  return "superfast";
}

int planes_of(const VideoFormat& format) {
  return format.sampling == VideoSampling::kLuma ? 1 : 3;
}

Result<Codec> open_encoder(const VideoFormat& format, VideoSpeed speed) {
  av_log_set_level(AV_LOG_FATAL);
  const AVCodec* x264 = avcodec_find_encoder_by_name("libx264");
  if (x264 == nullptr)
    return Error{"this libavcodec has no libx264: install Debian's, or choose another texture codec"};
  Codec codec(avcodec_alloc_context3(x264));
  codec->width = format.width;
  codec->height = format.height;
  codec->pix_fmt = pixel_format(format);
  codec->time_base = {1, 30};  // quality is asked for, not a rate: no bit depends on it
  codec->framerate = {30, 1};
  codec->thread_count = 1;
  codec->max_b_frames = 0;
  codec->color_range = AVCOL_RANGE_JPEG;
  codec->color_primaries = AVCOL_PRI_BT709;
  codec->color_trc = AVCOL_TRC_IEC61966_2_1;
  codec->colorspace = format.sampling == VideoSampling::kLuma ? AVCOL_SPC_UNSPECIFIED : AVCOL_SPC_SMPTE170M;
  codec->chroma_sample_location = AVCHROMA_LOC_CENTER;
  av_opt_set(codec->priv_data, "preset", preset(speed), 0);
  av_opt_set(codec->priv_data, "tune", "zerolatency", 0);
  av_opt_set_int(codec->priv_data, "forced-idr", 1, 0);
  // Who encodes says which pictures are key pictures, and nobody else.
  av_opt_set(codec->priv_data, "x264-params", "keyint=infinite:scenecut=0:sliced-threads=0", 0);
  av_opt_set_double(codec->priv_data, "crf", VideoPictureOptions{}.rate_factor, 0);
  if (const int code = avcodec_open2(codec.get(), x264, nullptr); code < 0)
    return Error{"H.264 cannot be encoded at " + std::to_string(format.width) + "x" +
                 std::to_string(format.height) + ": " + text_of(code)};
  return codec;
}

}  // namespace

// ---------------------------------------------------------------- encoder

struct VideoEncoder::State {
  VideoFormat format;
  VideoSpeed speed;
  Codec codec;
  Picture picture{av_frame_alloc()};
  Packet packet{av_packet_alloc()};
  std::int64_t count = 0;

  Status copy(const VideoView& from) {
    if (const int code = av_frame_make_writable(picture.get()); code < 0)
      return Error{"no memory for a picture: " + text_of(code)};
    const int sample_bytes = format.bits > 8 ? 2 : 1;
    for (int p = 0; p < planes_of(format); ++p) {
      const auto plane = static_cast<std::size_t>(p);
      const std::size_t row =
          static_cast<std::size_t>((p == 0 ? format.width : format.width / 2) * sample_bytes);
      for (int y = 0; y < (p == 0 ? format.height : format.height / 2); ++y)
        std::copy_n(from.planes[plane] + y * from.stride_bytes[plane], row,
                    picture->data[plane] + y * picture->linesize[plane]);
    }
    return {};
  }
};

VideoEncoder::VideoEncoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoEncoder::VideoEncoder(VideoEncoder&&) noexcept = default;
VideoEncoder& VideoEncoder::operator=(VideoEncoder&&) noexcept = default;
VideoEncoder::~VideoEncoder() = default;

Result<VideoEncoder> VideoEncoder::create(const VideoFormat& format, VideoSpeed speed) {
  if (auto status = check_video_format(format); !status) return status.error();
  auto codec = open_encoder(format, speed);
  if (!codec) return codec.error();
  auto state = std::make_unique<State>();
  state->format = format;
  state->speed = speed;
  state->codec = std::move(*codec);
  state->picture->format = state->codec->pix_fmt;
  state->picture->width = format.width;
  state->picture->height = format.height;
  state->picture->color_range = state->codec->color_range;
  if (const int code = av_frame_get_buffer(state->picture.get(), 0); code < 0)
    return Error{"no memory for a picture: " + text_of(code)};
  return VideoEncoder(std::move(state));
}

Result<bool> VideoEncoder::encode(const VideoView& picture, const VideoPictureOptions& options, Bytes& out) {
  State& s = *state_;
  if (!s.codec) {  // an error before: what the receivers have is not known any more
    auto codec = open_encoder(s.format, s.speed);
    if (!codec) return codec.error();
    s.codec = std::move(*codec);
  }
  if (auto status = s.copy(picture); !status) return status.error();
  av_opt_set_double(s.codec->priv_data, "crf", std::clamp(options.rate_factor, kFinest, kCoarsest), 0);
  s.picture->pts = s.count++;
  s.picture->pict_type = options.key ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  int code = avcodec_send_frame(s.codec.get(), s.picture.get());
  if (code >= 0) code = avcodec_receive_packet(s.codec.get(), s.packet.get());
  if (code < 0) {
    s.codec.reset();
    return Error{"a picture cannot be encoded as H.264: " + text_of(code)};
  }
  append_lean_unit({s.packet->data, static_cast<std::size_t>(s.packet->size)}, out);
  const bool is_key = (s.packet->flags & AV_PKT_FLAG_KEY) != 0;
  av_packet_unref(s.packet.get());
  return is_key;
}

// ---------------------------------------------------------------- decoder

struct VideoDecoder::State {
  Codec codec;
  Picture picture{av_frame_alloc()};
  Packet packet{av_packet_alloc()};
  VideoFormat format;  // of the pictures it holds
  bool has_picture = false;

  Status open() {
    av_log_set_level(AV_LOG_FATAL);
    const AVCodec* h264 = avcodec_find_decoder(AV_CODEC_ID_H264);
    if (h264 == nullptr) return Error{"this libavcodec has no H.264 decoder: install Debian's"};
    codec.reset(avcodec_alloc_context3(h264));
    codec->thread_count = 1;
    codec->flags |= AV_CODEC_FLAG_LOW_DELAY;
    codec->err_recognition = AV_EF_EXPLODE;
    codec->error_concealment = 0;
    if (const int code = avcodec_open2(codec.get(), h264, nullptr); code < 0)
      return Error{"H.264 cannot be decoded: " + text_of(code)};
    return {};
  }
  Status take(std::span<const std::uint8_t> unit) {
    if (const int code = av_new_packet(packet.get(), static_cast<int>(unit.size())); code < 0)
      return Error{"no memory for a picture: " + text_of(code)};
    std::copy(unit.begin(), unit.end(), packet->data);
    int code = avcodec_send_packet(codec.get(), packet.get());
    av_packet_unref(packet.get());
    if (code >= 0) code = avcodec_receive_frame(codec.get(), picture.get());
    if (code < 0) return Error{"video cannot be decoded: " + text_of(code)};
    const bool damaged = (picture->flags & AV_FRAME_FLAG_CORRUPT) != 0 || picture->decode_error_flags != 0;
    if (damaged || picture->width != format.width || picture->height != format.height ||
        !is_format(picture->format, format))
      return Error{"video is damaged"};
    return {};
  }
};

VideoDecoder::VideoDecoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoDecoder::VideoDecoder(VideoDecoder&&) noexcept = default;
VideoDecoder& VideoDecoder::operator=(VideoDecoder&&) noexcept = default;
VideoDecoder::~VideoDecoder() = default;

Result<VideoDecoder> VideoDecoder::create() {
  auto state = std::make_unique<State>();
  if (auto status = state->open(); !status) return status.error();
  return VideoDecoder(std::move(state));
}

Result<VideoView> VideoDecoder::decode(std::span<const std::uint8_t> unit, const VideoFormat& format) {
  State& s = *state_;
  const auto is_key = check_access_unit(unit, format);
  if (!is_key) return is_key.error();
  if (!*is_key && (!s.has_picture || s.format != format))
    return Error{"video builds on a picture that is not there: wait for the next key frame"};
  s.format = format;
  s.has_picture = false;
  if (*is_key) avcodec_flush_buffers(s.codec.get());
  Status done = s.take(unit);
  if (!done && *is_key) {  // damage before may have left it in any state
    if (auto status = s.open(); !status) return status.error();
    done = s.take(unit);
  }
  if (!done) return done.error();
  s.has_picture = true;
  VideoView view;
  for (std::size_t p = 0; p < static_cast<std::size_t>(planes_of(format)); ++p) {
    view.planes[p] = s.picture->data[p];
    view.stride_bytes[p] = s.picture->linesize[p];
  }
  return view;
}

}  // namespace relievo
