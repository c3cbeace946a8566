// SPDX-License-Identifier: Apache-2.0
// In builds without libavcodec.
#include "codec/video_coder.h"

namespace relievo {
namespace {

const Error kMissing{
    "this build has no H.264: install libavcodec-dev, configure again with -DRELIEVO_VIDEO=ON and build, or "
    "choose another codec"};

}  // namespace

const ChosenVideoEncoder& chosen_video_encoder() {
  static const ChosenVideoEncoder chosen{.why_not_hardware = kMissing.message};
  return chosen;
}

struct VideoEncoder::State {};
struct VideoDecoder::State {};

VideoEncoder::VideoEncoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoEncoder::VideoEncoder(VideoEncoder&&) noexcept = default;
VideoEncoder& VideoEncoder::operator=(VideoEncoder&&) noexcept = default;
VideoEncoder::~VideoEncoder() = default;
Result<VideoEncoder> VideoEncoder::create(const VideoFormat&, VideoSpeed, VideoEncoderKind, int) {
  return kMissing;
}
Result<bool> VideoEncoder::encode(const VideoView&, const VideoPictureOptions&, Bytes&) {
  return kMissing;
}
Result<VideoPlanes> VideoEncoder::next_picture() {
  return kMissing;
}
Result<bool> VideoEncoder::encode(const VideoPictureOptions&, Bytes&) {
  return kMissing;
}
std::string VideoEncoder::take_notice() {
  return {};
}

VideoDecoder::VideoDecoder(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoDecoder::VideoDecoder(VideoDecoder&&) noexcept = default;
VideoDecoder& VideoDecoder::operator=(VideoDecoder&&) noexcept = default;
VideoDecoder::~VideoDecoder() = default;
Result<VideoDecoder> VideoDecoder::create() {
  return kMissing;
}
Result<VideoView> VideoDecoder::decode(std::span<const std::uint8_t>, const VideoFormat&) {
  return kMissing;
}

}  // namespace relievo
