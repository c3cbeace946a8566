// SPDX-License-Identifier: Apache-2.0
#include "client/picture_video.h"

#include <utility>

namespace relievo {
namespace {

constexpr int kQuality = 90;
constexpr int kKeyInterval = 30;

}  // namespace

PictureVideo::PictureVideo(VideoFile file)
    : file_(std::move(file)), encoder_(make_texture_encoder(TextureCodec::kH264)) {}

Status PictureVideo::add(View8 picture, std::int64_t time_ns) {
  coded_.clear();
  const auto key =
      encoder_->encode(picture, {.quality = kQuality, .key = number_++ % kKeyInterval == 0}, coded_);
  if (!key) return key.error();
  return file_.add(coded_, picture.width, picture.height, time_ns);
}

}  // namespace relievo
