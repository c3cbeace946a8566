// SPDX-License-Identifier: Apache-2.0
// libavcodec's H.264 encoders: how each is opened for pictures without delay. For video_coder.cpp alone.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "codec/video_coder.h"

struct AVCodecContext;
struct AVFrame;
struct AVPacket;

namespace relievo {

struct FreeAv {
  void operator()(AVCodecContext* codec) const;
  void operator()(AVFrame* picture) const;
  void operator()(AVPacket* packet) const;
};
using AvCodec = std::unique_ptr<AVCodecContext, FreeAv>;
using AvPicture = std::unique_ptr<AVFrame, FreeAv>;
using AvPacket = std::unique_ptr<AVPacket, FreeAv>;

std::string av_text(int code);
/// An AVPixelFormat.
int av_pixel_format(const VideoFormat& format);

/// libavcodec's.
const char* h264_encoder_name(VideoEncoderKind kind);

/// Those that take another quality only when they are opened anew; x264 takes it picture by picture.
bool opens_for_quality(VideoEncoderKind kind);

/// Not kAuto; `slices` as VideoEncoder::create() takes them. The error says what is missing and how to mend
/// it.
Result<AvCodec> open_h264_encoder(VideoEncoderKind kind, const VideoFormat& format, VideoSpeed speed,
                                  int slices, double rate_factor);

/// One picture in, one packet out.
Result<AvPacket> encode_at_once(AVCodecContext& codec, AVFrame& picture);

}  // namespace relievo
