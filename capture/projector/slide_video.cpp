// SPDX-License-Identifier: Apache-2.0
#include "capture/projector/slide_video.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
}

#include <cmath>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/whole_file.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

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

std::string text_of(int code) {
  constexpr int kMostErrno = 4095;
  if (const int error = AVUNERROR(code); error > 0 && error <= kMostErrno) return write_failure(error);
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof text);
  return text;
}

/// 29.97 is 30000/1001, as TV has it.
AVRational rational(double rate) {
  const double thousandths = std::round(rate * 1.001) * 1000;
  if (std::fabs(thousandths / 1001 - rate) < 1e-4 * rate && std::fabs(std::round(rate) - rate) > 1e-6)
    return {static_cast<int>(thousandths), 1001};
  return av_d2q(rate, 1'000'000);
}

/// An output file that is under a name of its own until it is whole, and removed unless it is kept.
class Muxer {
 public:
  explicit Muxer(fs::path name) : name_(std::move(name)), file_(unfinished_name(name_)) {}
  Muxer(const Muxer&) = delete;
  Muxer& operator=(const Muxer&) = delete;
  ~Muxer() {
    close();
    std::error_code ignored;
    if (!file_.empty()) fs::remove(file_, ignored);
  }

  Status open() {
    if (const int code = avformat_alloc_output_context2(&context_, nullptr, "matroska", nullptr); code < 0)
      return Error{"no Matroska writer: " + text_of(code)};
    if (const int code = avio_open(&context_->pb, file_.c_str(), AVIO_FLAG_WRITE); code < 0)
      return Error{"cannot write " + name_.string() + ": " + text_of(code)};
    return {};
  }
  Status keep() {
    if (const int code = close(); code < 0)
      return Error{"cannot write " + name_.string() + ": " + text_of(code)};
    std::error_code failed;
    fs::rename(file_, name_, failed);
    if (failed) return Error{"cannot write " + name_.string() + ": " + failed.message()};
    file_.clear();
    return {};
  }
  AVFormatContext* operator->() { return context_; }
  AVFormatContext* get() { return context_; }

 private:
  int close() {
    if (context_ == nullptr) return 0;
    const int code = context_->pb != nullptr ? avio_closep(&context_->pb) : 0;
    avformat_free_context(context_);
    context_ = nullptr;
    return code;
  }

  fs::path name_, file_;
  AVFormatContext* context_ = nullptr;
};

Result<Codec> open_encoder(const SlideVideoOptions& options, AVRational rate) {
  const AVCodec* ffv1 = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  if (ffv1 == nullptr) return Error{"this libavcodec has no FFV1 encoder: install Debian's"};
  Codec codec(avcodec_alloc_context3(ffv1));
  codec->width = options.width;
  codec->height = options.height;
  codec->pix_fmt = AV_PIX_FMT_0RGB32;
  codec->time_base = av_inv_q(rate);
  codec->framerate = rate;
  codec->gop_size = 1;  // each picture by itself, so that a cycle's packets may be repeated
  codec->level = 3;     // of FFV1: checksums
  codec->sample_aspect_ratio = {1, 1};
  codec->color_range = AVCOL_RANGE_JPEG;
  codec->colorspace = AVCOL_SPC_RGB;
  codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  codec->field_order = AV_FIELD_PROGRESSIVE;
  if (options.interlaced) {
    codec->flags |= AV_CODEC_FLAG_INTERLACED_DCT | AV_CODEC_FLAG_INTERLACED_ME;
    codec->field_order = options.field_order == FieldOrder::kTop ? AV_FIELD_TT : AV_FIELD_BB;
  }
  av_opt_set_int(codec->priv_data, "slicecrc", 1, 0);
  av_opt_set_int(codec->priv_data, "coder", 1, 0);  // a range coder with large contexts: a tenth of the size,
  av_opt_set_int(codec->priv_data, "context", 1, 0);  // since each row is like the one two above
  if (const int code = avcodec_open2(codec.get(), ffv1, nullptr); code < 0)
    return Error{"FFV1 cannot be encoded at " + std::to_string(options.width) + "x" +
                 std::to_string(options.height) + ": " + text_of(code)};
  return codec;
}

Result<Packet> encode(AVCodecContext& codec, const Image8& picture, const SlideVideoOptions& options,
                      std::int64_t number) {
  Picture frame(av_frame_alloc());
  frame->format = codec.pix_fmt;
  frame->width = codec.width;
  frame->height = codec.height;
  frame->pts = number;
  frame->interlaced_frame = options.interlaced;
  frame->top_field_first = options.interlaced && options.field_order == FieldOrder::kTop;
  if (const int code = av_frame_get_buffer(frame.get(), 0); code < 0)
    return Error{"no memory for a picture: " + text_of(code)};
  for (int y = 0; y < codec.height; ++y) {
    const std::uint8_t* from = picture.row(y);
    auto* to = reinterpret_cast<std::uint32_t*>(frame->data[0] + y * frame->linesize[0]);
    for (int x = 0; x < codec.width; ++x, from += 3)
      to[x] = static_cast<std::uint32_t>(from[0]) << 16 | static_cast<std::uint32_t>(from[1]) << 8 | from[2];
  }
  Packet packet(av_packet_alloc());
  int code = avcodec_send_frame(&codec, frame.get());
  if (code >= 0) code = avcodec_receive_packet(&codec, packet.get());
  if (code < 0) return Error{"a picture cannot be encoded: " + text_of(code)};
  return packet;
}

}  // namespace

Result<SlideVideo> write_slide_video(const fs::path& file, const Pattern& pattern,
                                     const SlideVideoOptions& options) {
  const auto target = where_to_write(file);
  if (!target) return target.error();
  av_log_set_level(AV_LOG_FATAL);
  AVRational rate = rational(options.frame_rate);
  if (!options.interlaced) rate = av_mul_q(rate, {2, 1});
  Result<Codec> codec = open_encoder(options, rate);
  if (!codec) return codec.error();

  std::vector<Packet> cycle;
  const auto add = [&](const Image8& picture) -> Status {
    auto packet = encode(**codec, picture, options, static_cast<std::int64_t>(cycle.size()));
    if (!packet) return packet.error();
    cycle.push_back(*std::move(packet));
    return {};
  };
  for (int frame = 0; frame < cycle_frames(pattern); ++frame) {
    if (options.interlaced) {
      if (auto s = add(draw_interlaced(pattern, frame, options.field_order, options.width, options.height));
          !s)
        return s.error();
      continue;
    }
    for (const int half : {0, 1}) {
      const Exposure exposure = shown(pattern, static_cast<std::uint64_t>(frame), half);
      if (auto s = add(draw_field(pattern, exposure, options.width, options.height)); !s) return s.error();
    }
  }

  Muxer muxer(*target);
  if (auto opened = muxer.open(); !opened) return opened.error();
  AVStream* stream = avformat_new_stream(muxer.get(), nullptr);
  avcodec_parameters_from_context(stream->codecpar, codec->get());
  stream->time_base = (*codec)->time_base;
  stream->avg_frame_rate = rate;
  if (const int code = avformat_write_header(muxer.get(), nullptr); code < 0)
    return Error{file.string() + " cannot be begun: " + text_of(code)};

  const double wanted = options.duration_s * av_q2d(rate);
  const auto cycles = std::max<std::uint64_t>(
      1, static_cast<std::uint64_t>(std::ceil(wanted / static_cast<double>(cycle.size()) - 1e-9)));
  SlideVideo out{cycles * cycle.size(), rate.num, rate.den};
  for (std::uint64_t n = 0; n < out.pictures; ++n) {
    if (n % 64 == 0 && options.stopped && options.stopped())
      return Error{"stopped: nothing was written to " + file.string()};
    Packet packet(av_packet_clone(cycle[n % cycle.size()].get()));
    packet->pts = packet->dts = static_cast<std::int64_t>(n);
    packet->duration = 1;
    packet->stream_index = 0;
    av_packet_rescale_ts(packet.get(), (*codec)->time_base, stream->time_base);
    if (const int code = av_interleaved_write_frame(muxer.get(), packet.get()); code < 0)
      return Error{"cannot write " + file.string() + ": " + text_of(code)};
  }
  if (const int code = av_write_trailer(muxer.get()); code < 0)
    return Error{"cannot write " + file.string() + ": " + text_of(code)};
  if (auto kept = muxer.keep(); !kept) return kept.error();
  return out;
}

}  // namespace relievo
