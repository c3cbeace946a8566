// SPDX-License-Identifier: Apache-2.0
#include "codec/h264_encoders.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/hwcontext.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace relievo {
namespace {

constexpr int kNoKeyOfItsOwn = 1 << 15;  // pictures; who encodes says which are key pictures

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

Status set_x264(AVCodecContext& codec, VideoSpeed speed, double rate_factor) {
  av_opt_set(codec.priv_data, "preset", preset(speed), 0);
  av_opt_set(codec.priv_data, "tune", "zerolatency", 0);
  av_opt_set_int(codec.priv_data, "forced-idr", 1, 0);
  // Who encodes says which pictures are key pictures, and nobody else. Adaptive quantisation would spend most
  // bits on the noise of what no light falls on.
  av_opt_set(codec.priv_data, "x264-params", "keyint=infinite:scenecut=0:aq-mode=0", 0);
  av_opt_set_double(codec.priv_data, "crf", rate_factor, 0);
  return {};
}

Status set_nvenc(AVCodecContext& codec, VideoSpeed, double rate_factor) {
  codec.gop_size = -1;
  av_opt_set(codec.priv_data, "preset", "p3", 0);
  av_opt_set(codec.priv_data, "tune", "ull", 0);
  av_opt_set(codec.priv_data, "rc", "constqp", 0);
  av_opt_set_int(codec.priv_data, "qp", std::lround(rate_factor), 0);
  av_opt_set_int(codec.priv_data, "zerolatency", 1, 0);
  av_opt_set_int(codec.priv_data, "delay", 0, 0);
  av_opt_set_int(codec.priv_data, "forced-idr", 1, 0);
  return {};
}

/// The device, and frames of its own that pictures are copied into.
Status set_vaapi(AVCodecContext& codec, VideoSpeed, double rate_factor) {
  AVBufferRef* device = nullptr;
  if (const int code = av_hwdevice_ctx_create(&device, AV_HWDEVICE_TYPE_VAAPI, nullptr, nullptr, 0); code < 0)
    return Error{"no VA-API device opens: " + av_text(code)};
  AVBufferRef* frames = av_hwframe_ctx_alloc(device);
  av_buffer_unref(&device);
  if (frames == nullptr) return Error{"no memory for frames of the VA-API device"};
  auto* settings = reinterpret_cast<AVHWFramesContext*>(frames->data);
  settings->format = AV_PIX_FMT_VAAPI;
  settings->sw_format = codec.pix_fmt;
  settings->width = codec.width;
  settings->height = codec.height;
  settings->initial_pool_size = 4;
  codec.pix_fmt = AV_PIX_FMT_VAAPI;
  codec.hw_frames_ctx = frames;  // freed with the codec
  if (const int code = av_hwframe_ctx_init(frames); code < 0)
    return Error{"the VA-API device takes no such pictures: " + av_text(code)};
  codec.gop_size = kNoKeyOfItsOwn;
  codec.global_quality = static_cast<int>(std::lround(rate_factor));
  av_opt_set(codec.priv_data, "rc_mode", "CQP", 0);
  av_opt_set_int(codec.priv_data, "async_depth", 1, 0);
  return {};
}

/// It knows rates only: about that of libx264 with this factor.
Status set_v4l2m2m(AVCodecContext& codec, VideoSpeed, double rate_factor) {
  constexpr double kBitsAPixel = 0.1, kAtFactor = 23, kHalves = 6;
  const double pixels = 30.0 * codec.width * codec.height;
  codec.gop_size = kNoKeyOfItsOwn;
  codec.bit_rate = std::llround(pixels * kBitsAPixel * std::exp2((kAtFactor - rate_factor) / kHalves));
  return {};
}

/// What libavcodec logs on this thread as the reason why something fails, while one lives; nothing of that is
/// printed.
class LoggedReason {
 public:
  LoggedReason() {
    here_ = this;
    av_log_set_callback(take);
  }
  ~LoggedReason() { here_ = nullptr; }
  LoggedReason(const LoggedReason&) = delete;
  LoggedReason& operator=(const LoggedReason&) = delete;

  /// The first line, in brackets; or nothing.
  std::string text() const { return reason_.empty() ? std::string() : " (" + reason_ + ")"; }

 private:
  static void take(void* context, int level, const char* format, va_list values) {
    if (here_ == nullptr) return av_log_default_callback(context, level, format, values);
    if (level > AV_LOG_ERROR || !here_->reason_.empty()) return;
    char line[200];
    std::vsnprintf(line, sizeof line, format, values);
    here_->reason_ = line;
    while (!here_->reason_.empty() && std::isspace(static_cast<unsigned char>(here_->reason_.back())))
      here_->reason_.pop_back();
  }

  inline static thread_local LoggedReason* here_ = nullptr;
  std::string reason_;
};

/// An encoder is a row here, the best first.
struct Row {
  VideoEncoderKind kind;
  const char* name;  // libavcodec's
  Status (*set)(AVCodecContext& codec, VideoSpeed speed, double rate_factor);
};
constexpr std::array kRows{Row{VideoEncoderKind::kNvenc, "h264_nvenc", set_nvenc},
                           Row{VideoEncoderKind::kVaapi, "h264_vaapi", set_vaapi},
                           Row{VideoEncoderKind::kV4l2m2m, "h264_v4l2m2m", set_v4l2m2m},
                           Row{VideoEncoderKind::kX264, "libx264", set_x264}};

void describe_pictures(const VideoFormat& format, int slices, AVCodecContext& codec) {
  codec.width = format.width;
  codec.height = format.height;
  codec.pix_fmt = static_cast<AVPixelFormat>(av_pixel_format(format));
  codec.time_base = {1, 30};  // quality is asked for, not a rate: no bit depends on it
  codec.framerate = {30, 1};
  codec.thread_count = slices;
  codec.thread_type = slices > 1 ? FF_THREAD_SLICE : FF_THREAD_FRAME;
  codec.max_b_frames = 0;
  codec.color_range = AVCOL_RANGE_JPEG;
  codec.color_primaries = AVCOL_PRI_BT709;
  codec.color_trc = AVCOL_TRC_IEC61966_2_1;
  codec.colorspace = format.sampling == VideoSampling::kLuma ? AVCOL_SPC_UNSPECIFIED : AVCOL_SPC_SMPTE170M;
  codec.chroma_sample_location = AVCHROMA_LOC_CENTER;
}

/// Whether a hardware encoder gives a key picture at once that our decoders take: they are strict, and some
/// drivers hold pictures back.
Status try_out(VideoEncoderKind kind) {
  const VideoFormat format{.width = 640, .height = 480};
  auto encoder = VideoEncoder::create(format, VideoSpeed::kSuperfast, kind);
  if (!encoder) return encoder.error();
  const Bytes grey(static_cast<std::size_t>(format.width * format.height), 128);
  const VideoView picture{.planes = {grey.data(), grey.data(), grey.data()},
                          .stride_bytes = {format.width, format.width / 2, format.width / 2}};
  Bytes unit;
  const auto is_key = encoder->encode(picture, {}, unit);
  if (!is_key) return is_key.error();
  const auto checked = check_access_unit(unit, format);
  if (!checked) return checked.error();
  return *is_key && *checked ? Status() : Status(Error{"its first picture is no key picture"});
}

}  // namespace

void FreeAv::operator()(AVCodecContext* codec) const {
  avcodec_free_context(&codec);
}
void FreeAv::operator()(AVFrame* picture) const {
  av_frame_free(&picture);
}
void FreeAv::operator()(AVPacket* packet) const {
  av_packet_free(&packet);
}

std::string av_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

int av_pixel_format(const VideoFormat& format) {
  if (format.sampling == VideoSampling::kLuma) return format.bits == 8 ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_GRAY10;
  return format.bits == 8 ? AV_PIX_FMT_YUV420P : AV_PIX_FMT_YUV420P10;
}

const char* h264_encoder_name(VideoEncoderKind kind) {
  return std::ranges::find(kRows, kind, &Row::kind)->name;
}

bool opens_for_quality(VideoEncoderKind kind) {
  return kind != VideoEncoderKind::kX264;
}

Result<AvCodec> open_h264_encoder(VideoEncoderKind kind, const VideoFormat& format, VideoSpeed speed,
                                  int slices, double rate_factor) {
  av_log_set_level(AV_LOG_FATAL);
  const Row& row = *std::ranges::find(kRows, kind, &Row::kind);
  const AVCodec* found = avcodec_find_encoder_by_name(row.name);
  const bool is_x264 = kind == VideoEncoderKind::kX264;
  if (found == nullptr)
    return Error{std::string("this libavcodec has no ") + row.name +
                 (is_x264 ? ": install Debian's, or choose another texture codec"
                          : ": choose another --texture-encoder, or auto")};
  AvCodec codec(avcodec_alloc_context3(found));
  describe_pictures(format, is_x264 ? slices : 1, *codec);
  const LoggedReason reason;
  Status ready = row.set(*codec, speed, rate_factor);
  if (ready)
    if (const int code = avcodec_open2(codec.get(), found, nullptr); code < 0)
      ready = Error{"it does not open at " + std::to_string(format.width) + "x" +
                    std::to_string(format.height) + ": " + av_text(code) + reason.text()};
  if (!ready)
    return Error{std::string("H.264 cannot be encoded by ") + row.name + ": " + ready.error().message +
                 (is_x264 ? "" : "; choose another --texture-encoder, or auto")};
  return codec;
}

Result<AvPacket> encode_at_once(AVCodecContext& codec, AVFrame& picture) {
  AVFrame* frame = &picture;
  AvPicture uploaded;
  if (codec.hw_frames_ctx != nullptr) {
    uploaded.reset(av_frame_alloc());
    int code = av_hwframe_get_buffer(codec.hw_frames_ctx, uploaded.get(), 0);
    if (code >= 0) code = av_hwframe_transfer_data(uploaded.get(), &picture, 0);
    if (code >= 0) code = av_frame_copy_props(uploaded.get(), &picture);
    if (code < 0) return Error{"a picture cannot be given to the device: " + av_text(code)};
    frame = uploaded.get();
    frame->pict_type = picture.pict_type;
  }
  AvPacket packet(av_packet_alloc());
  int code = avcodec_send_frame(&codec, frame);
  if (code >= 0) code = avcodec_receive_packet(&codec, packet.get());
  if (code < 0) return Error{"a picture cannot be encoded as H.264: " + av_text(code)};
  return packet;
}

const ChosenVideoEncoder& chosen_video_encoder() {
  static const ChosenVideoEncoder chosen = [] {
    ChosenVideoEncoder out;
    for (const Row& row : kRows) {
      out.kind = row.kind;
      if (row.kind == VideoEncoderKind::kX264) break;
      const Status works = try_out(row.kind);
      if (works) {
        out.why_not_hardware.clear();
        break;
      }
      if (!out.why_not_hardware.empty()) out.why_not_hardware += "; ";
      out.why_not_hardware += works.error().message;
    }
    return out;
  }();
  return chosen;
}

}  // namespace relievo
