// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_webp.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <string>

namespace relievo {
namespace {

/// libwebp's picture with what belongs to it.
class Picture {
 public:
  Picture() { valid_ = WebPPictureInit(&picture_) != 0; }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;
  ~Picture() { WebPPictureFree(&picture_); }
  bool valid() const { return valid_; }
  WebPPicture* operator->() { return &picture_; }
  WebPPicture* get() { return &picture_; }

 private:
  WebPPicture picture_{};
  bool valid_ = false;
};

int append_bytes_of(const std::uint8_t* data, std::size_t size, const WebPPicture* picture) {
  auto& out = *static_cast<Bytes*>(picture->custom_ptr);
  out.insert(out.end(), data, data + size);
  return 1;
}

Image8 as_rgb(View8 grey) {
  Image8 rgb(grey.width, grey.height, 3);
  for (int y = 0; y < grey.height; ++y)
    for (int x = 0; x < grey.width; ++x)
      for (int c = 0; c < 3; ++c) rgb.row(y)[3 * x + c] = grey.row(y)[x];
  return rgb;
}

}  // namespace

Status append_webp(View8 picture, int quality, Bytes& out) {
  if (picture.channels != 3 && picture.channels != 1)
    return Error{"texture has " + std::to_string(picture.channels) + " channels, not 3 (RGB) or 1 (grey)"};
  if (picture.width > WEBP_MAX_DIMENSION || picture.height > WEBP_MAX_DIMENSION)
    return Error{"texture is larger than a WebP can be (16383 pixels a side)"};
  Image8 rgb;
  if (picture.channels == 1) {
    rgb = as_rgb(picture);
    picture = rgb.view();
  }
  WebPConfig config;
  Picture coded;
  if (!coded.valid() || WebPConfigInit(&config) == 0)
    return Error{"libwebp is of another version than built with"};
  config.quality = static_cast<float>(quality);
  config.method = 0;
  coded->width = picture.width;
  coded->height = picture.height;
  coded->writer = append_bytes_of;
  coded->custom_ptr = &out;
  const std::size_t start = out.size();
  const bool done = WebPPictureImportRGB(coded.get(), picture.data, static_cast<int>(picture.stride)) != 0 &&
                    WebPEncode(&config, coded.get()) != 0;
  if (done) return {};
  out.resize(start);
  return Error{"texture cannot be encoded as WebP (libwebp's error " + std::to_string(coded->error_code) +
               ")"};
}

Result<Image8> decode_webp(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height) {
  WebPBitstreamFeatures found;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &found) != VP8_STATUS_OK)
    return Error{"texture is no WebP, or a damaged one"};
  if (static_cast<std::uint32_t>(found.width) != width || static_cast<std::uint32_t>(found.height) != height)
    return Error{"texture is " + std::to_string(found.width) + "x" + std::to_string(found.height) +
                 ", but the frame declares " + std::to_string(width) + "x" + std::to_string(height)};
  if (found.has_animation != 0 || found.has_alpha != 0)
    return Error{"texture is a WebP with movement or alpha, which the format does not allow"};
  Image8 picture(found.width, found.height, 3);
  if (WebPDecodeRGBInto(bytes.data(), bytes.size(), picture.data(), picture.size(),
                        static_cast<int>(picture.stride())) == nullptr)
    return Error{"texture is a damaged WebP"};
  return picture;
}

}  // namespace relievo
