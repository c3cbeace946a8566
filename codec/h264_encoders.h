// SPDX-License-Identifier: Apache-2.0
// libavcodec's H.264 encoders: how each is opened for pictures without delay. For video_coder.cpp alone.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
}

#include <memory>
#include <string>

#include "base/result.h"
#include "codec/video_coder.h"

namespace relievo {

template <auto Free>
struct FreeWith {
  template <typename T>
  void operator()(T* pointer) const {
    Free(&pointer);
  }
};
using AvCodec = std::unique_ptr<AVCodecContext, FreeWith<avcodec_free_context>>;
using AvPicture = std::unique_ptr<AVFrame, FreeWith<av_frame_free>>;
using AvPacket = std::unique_ptr<AVPacket, FreeWith<av_packet_free>>;

std::string av_text(int code);
AVPixelFormat av_pixel_format(const VideoFormat& format);

/// Those that take another quality only when they are opened anew; x264 takes it picture by picture.
bool opens_for_quality(VideoEncoderKind kind);

/// Not kAuto. The error says what is missing and how to mend it.
Result<AvCodec> open_h264_encoder(VideoEncoderKind kind, const VideoFormat& format, VideoSpeed speed,
                                  double rate_factor);

/// One picture in, one packet out.
Result<AvPacket> encode_at_once(AVCodecContext& codec, AVFrame& picture);

}  // namespace relievo
