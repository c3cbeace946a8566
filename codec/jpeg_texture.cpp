// SPDX-License-Identifier: Apache-2.0
#include "codec/jpeg_texture.h"

#include <turbojpeg.h>

#include <memory>
#include <string>

namespace relievo {
namespace {

struct Destroy {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using Handle = std::unique_ptr<void, Destroy>;

constexpr int kLargestSide = 65500;  // libjpeg's own limit

Error turbojpeg_error(const char* what, tjhandle handle) {
  return {std::string("texture cannot be ") + what + ": " + tjGetErrorStr2(handle)};
}

/// The first frame marker (SOFn), 0 where there is none: what kind of JPEG it is.
std::uint8_t frame_marker(std::span<const std::uint8_t> bytes) {
  std::size_t at = 2;  // behind SOI
  while (at + 4 <= bytes.size() && bytes[at] == 0xff) {
    const std::uint8_t marker = bytes[at + 1];
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) return marker;
    at += 2u + static_cast<std::size_t>(bytes[at + 2] << 8 | bytes[at + 3]);
  }
  return 0;
}

Result<Image8> decode(tjhandle handle, std::span<const std::uint8_t> bytes, std::uint32_t width,
                      std::uint32_t height) {
  const std::uint8_t kind = frame_marker(bytes);
  if (kind != 0xc0 && kind != 0xc1)
    return Error{"texture is not a sequential JPEG, the only kind the format allows"};
  int found_width = 0;
  int found_height = 0;
  int sampling = 0;
  int space = 0;
  if (tjDecompressHeader3(handle, bytes.data(), bytes.size(), &found_width, &found_height, &sampling,
                          &space) != 0)
    return turbojpeg_error("decoded", handle);
  if (static_cast<std::uint32_t>(found_width) != width || static_cast<std::uint32_t>(found_height) != height)
    return Error{"texture is " + std::to_string(found_width) + "x" + std::to_string(found_height) +
                 ", but the frame declares " + std::to_string(width) + "x" + std::to_string(height)};
  if (space != TJCS_YCbCr && space != TJCS_GRAY)
    return Error{"texture is a JPEG in a colour space that the format does not allow"};
  Image8 picture(found_width, found_height, 3);
  if (tjDecompress2(handle, bytes.data(), bytes.size(), picture.data(), found_width,
                    static_cast<int>(picture.stride()), found_height, TJPF_RGB,
                    TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0)
    return turbojpeg_error("decoded", handle);
  return picture;
}

}  // namespace

Status append_jpeg(View8 picture, int quality, Bytes& out) {
  if (picture.channels != 3 && picture.channels != 1)
    return Error{"texture has " + std::to_string(picture.channels) + " channels, not 3 (RGB) or 1 (grey)"};
  if (picture.width > kLargestSide || picture.height > kLargestSide)
    return Error{"texture is larger than a JPEG can be (65500 pixels a side)"};
  thread_local const Handle handle(tjInitCompress());
  if (!handle) return turbojpeg_error("encoded", nullptr);
  const bool grey = picture.channels == 1;
  const int sampling = grey ? TJSAMP_GRAY : TJSAMP_420;
  const std::size_t start = out.size();
  unsigned long size = tjBufSize(picture.width, picture.height, sampling);
  out.resize(start + size);
  unsigned char* target = out.data() + start;
  const int rc =
      tjCompress2(handle.get(), picture.data, picture.width, static_cast<int>(picture.stride), picture.height,
                  grey ? TJPF_GRAY : TJPF_RGB, &target, &size, sampling, quality, TJFLAG_NOREALLOC);
  if (rc != 0) {
    out.resize(start);
    return turbojpeg_error("encoded", handle.get());
  }
  out.resize(start + size);
  return {};
}

Result<Image8> decode_jpeg(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height) {
  thread_local Handle handle;
  if (!handle) handle.reset(tjInitDecompress());
  if (!handle) return turbojpeg_error("decoded", nullptr);
  auto picture = decode(handle.get(), bytes, width, height);
  if (!picture) handle.reset();  // it may go on where a damaged one ended (libjpeg-turbo 2.1.5)
  return picture;
}

}  // namespace relievo
