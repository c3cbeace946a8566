// SPDX-License-Identifier: Apache-2.0
#include "codec/video_coder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <thread>
#include <utility>

#include "codec/h264_encoders.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

namespace relievo {
namespace {

constexpr double kFinest = 1;  // 0 is another profile, lossless
constexpr double kCoarsest = 51;
constexpr double kQualityStep =
    2;  // of those that open anew for another quality, and begin with a key picture
constexpr const char* kFellBack = "H.264 by x264 from now on: ";

/// What libavcodec's decoder may call it: full range has names of its own, and it adds chroma to luma.
bool is_format(int found, const VideoFormat& format) {
  if (found == av_pixel_format(format)) return true;
  return format.bits == 8 ? found == AV_PIX_FMT_YUVJ420P || found == AV_PIX_FMT_YUV420P
                          : found == AV_PIX_FMT_YUV420P10;
}

int planes_of(const VideoFormat& format) {
  return format.sampling == VideoSampling::kLuma ? 1 : 3;
}

}  // namespace

// ---------------------------------------------------------------- encoder

struct VideoEncoder::State {
  VideoFormat format;
  VideoSpeed speed;
  VideoEncoderKind kind;
  int slices = 1;
  AvCodec codec;
  AvPicture picture{av_frame_alloc()};
  std::int64_t count = 0;
  double opened_for = VideoPictureOptions{}.rate_factor;
  bool is_first = true;  // since it was opened
  std::string notice;

  Status open(double rate_factor) {
    auto opened = open_h264_encoder(kind, format, speed, slices, rate_factor);
    if (!opened) return opened.error();
    codec = std::move(*opened);
    opened_for = rate_factor;
    is_first = true;
    return {};
  }

  /// One picture, into `unit`; opened anew where that is needed.
  Result<bool> encode(const VideoPictureOptions& options, Bytes& unit) {
    const double factor = std::clamp(options.rate_factor, kFinest, kCoarsest);
    const bool is_other = opens_for_quality(kind) && std::fabs(factor - opened_for) >= kQualityStep;
    // After an error, too: what the receivers have is not known any more.
    if (!codec || is_other)
      if (auto status = open(factor); !status) return status.error();
    if (!opens_for_quality(kind)) av_opt_set_double(codec->priv_data, "crf", factor, 0);
    const bool wants_key = options.key || is_first;
    picture->pts = count++;
    picture->pict_type = wants_key ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
    const auto packet = encode_at_once(*codec, *picture);
    if (!packet) return packet.error().in(h264_encoder_name(kind));
    is_first = false;
    const AVPacket& coded = **packet;
    append_lean_unit({coded.data, static_cast<std::size_t>(coded.size)}, unit);
    const bool is_key = (coded.flags & AV_PKT_FLAG_KEY) != 0;
    if (kind == VideoEncoderKind::kX264) return is_key;
    const auto checked = check_access_unit(unit, format);  // drivers differ
    if (!checked) return checked.error().in(h264_encoder_name(kind));
    if (*checked != is_key || (wants_key && !is_key))
      return Error{std::string(h264_encoder_name(kind)) + " gives no key picture where one is asked for"};
    return is_key;
  }

  /// libx264 from the next picture on, which is a key picture.
  void fall_back(const Error& why) {
    notice = kFellBack + why.message;
    kind = VideoEncoderKind::kX264;
    codec.reset();
  }

  void copy(const VideoView& from) {
    const int sample_bytes = format.bits > 8 ? 2 : 1;
    for (int p = 0; p < planes_of(format); ++p) {
      const auto plane = static_cast<std::size_t>(p);
      const std::size_t row =
          static_cast<std::size_t>((p == 0 ? format.width : format.width / 2) * sample_bytes);
      for (int y = 0; y < (p == 0 ? format.height : format.height / 2); ++y)
        std::copy_n(from.planes[plane] + y * from.stride_bytes[plane], row,
                    picture->data[plane] + y * picture->linesize[plane]);
    }
  }
};

VideoEncoder::VideoEncoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoEncoder::VideoEncoder(VideoEncoder&&) noexcept = default;
VideoEncoder& VideoEncoder::operator=(VideoEncoder&&) noexcept = default;
VideoEncoder::~VideoEncoder() = default;

Result<VideoEncoder> VideoEncoder::create(const VideoFormat& format, VideoSpeed speed, VideoEncoderKind kind,
                                          int slices) {
  if (auto status = check_video_format(format); !status) return status.error();
  std::string notice;
  if (kind == VideoEncoderKind::kAuto) {
    const bool is_usual = format.bits == 8 && format.sampling != VideoSampling::kLuma;
    kind = is_usual ? chosen_video_encoder().kind : VideoEncoderKind::kX264;
    if (kind != VideoEncoderKind::kX264) {  // which takes sizes that hardware does not
      auto made = create(format, speed, kind, slices);
      if (made) return made;
      kind = VideoEncoderKind::kX264;
      notice = kFellBack + made.error().message;
    }
  }
  auto state = std::make_unique<State>();
  state->format = format;
  state->speed = speed;
  state->kind = kind;
  state->slices = slices;
  state->notice = std::move(notice);
  if (auto status = state->open(state->opened_for); !status) return status.error();
  state->picture->format = av_pixel_format(format);
  state->picture->width = format.width;
  state->picture->height = format.height;
  state->picture->color_range = state->codec->color_range;
  if (const int code = av_frame_get_buffer(state->picture.get(), 0); code < 0)
    return Error{"no memory for a picture: " + av_text(code)};
  return VideoEncoder(std::move(state));
}

Result<VideoPlanes> VideoEncoder::next_picture() {
  State& s = *state_;
  if (const int code = av_frame_make_writable(s.picture.get()); code < 0)
    return Error{"no memory for a picture: " + av_text(code)};
  VideoPlanes out;
  for (std::size_t p = 0; p < static_cast<std::size_t>(planes_of(s.format)); ++p) {
    out.planes[p] = s.picture->data[p];
    out.stride_bytes[p] = s.picture->linesize[p];
  }
  return out;
}

Result<bool> VideoEncoder::encode(const VideoView& picture, const VideoPictureOptions& options, Bytes& out) {
  if (const auto planes = next_picture(); !planes) return planes.error();
  state_->copy(picture);
  return encode(options, out);
}

Result<bool> VideoEncoder::encode(const VideoPictureOptions& options, Bytes& out) {
  State& s = *state_;
  Bytes unit;
  auto key = s.encode(options, unit);
  if (!key && s.kind != VideoEncoderKind::kX264) {
    s.fall_back(key.error());
    unit.clear();
    key = s.encode(options, unit);
  }
  if (!key) {
    s.codec.reset();
    return key.error();
  }
  out.insert(out.end(), unit.begin(), unit.end());
  return key;
}

std::string VideoEncoder::take_notice() {
  return std::exchange(state_->notice, {});
}

// ---------------------------------------------------------------- decoder

struct VideoDecoder::State {
  AvCodec codec;
  AvPicture picture{av_frame_alloc()};
  AvPacket packet{av_packet_alloc()};
  VideoFormat format;  // of the pictures it holds
  bool has_picture = false;

  Status open() {
    av_log_set_level(AV_LOG_FATAL);
    const AVCodec* h264 = avcodec_find_decoder(AV_CODEC_ID_H264);
    if (h264 == nullptr) return Error{"this libavcodec has no H.264 decoder: install Debian's"};
    codec.reset(avcodec_alloc_context3(h264));
    // Slices are decoded at once. One after the other, and without concealment, libavcodec takes every
    // picture of several for a damaged one.
    codec->thread_type = FF_THREAD_SLICE;
    codec->thread_count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()) / 2, 2, 4);
    codec->flags |= AV_CODEC_FLAG_LOW_DELAY;
    codec->err_recognition = AV_EF_EXPLODE;
    codec->error_concealment = 0;
    if (const int code = avcodec_open2(codec.get(), h264, nullptr); code < 0)
      return Error{"H.264 cannot be decoded: " + av_text(code)};
    return {};
  }
  Status take(std::span<const std::uint8_t> unit) {
    if (const int code = av_new_packet(packet.get(), static_cast<int>(unit.size())); code < 0)
      return Error{"no memory for a picture: " + av_text(code)};
    std::copy(unit.begin(), unit.end(), packet->data);
    int code = avcodec_send_packet(codec.get(), packet.get());
    av_packet_unref(packet.get());
    if (code >= 0) code = avcodec_receive_frame(codec.get(), picture.get());
    if (code < 0) return Error{"video cannot be decoded: " + av_text(code)};
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
