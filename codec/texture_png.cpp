// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_png.h"

#include <png.h>

#include <optional>
#include <string>

namespace relievo {
namespace {

/// libpng's description of a picture, with what it allocates.
struct Header {
  png_image image{};

  Header() { image.version = PNG_IMAGE_VERSION; }
  Header(const Header&) = delete;
  Header& operator=(const Header&) = delete;
  ~Header() { png_image_free(&image); }
};

constexpr std::size_t kFormatAt = 24;  // of a PNG: bit depth, colour type
constexpr std::uint8_t kGrey = 0;
constexpr std::uint8_t kRgb = 2;

std::optional<png_uint_32> format_of(int channels) {
  if (channels == 1) return PNG_FORMAT_GRAY;
  if (channels == 3) return PNG_FORMAT_RGB;
  if (channels == 4) return PNG_FORMAT_RGBA;
  return std::nullopt;
}

}  // namespace

Status append_png(View8 picture, PngEffort effort, Bytes& out) {
  const auto format = picture.empty() ? std::nullopt : format_of(picture.channels);
  if (!format) return Error{"a picture for a PNG is empty or neither RGB, RGBA nor grey"};
  Header header;
  header.image.width = static_cast<png_uint_32>(picture.width);
  header.image.height = static_cast<png_uint_32>(picture.height);
  header.image.format = *format;
  header.image.flags = effort == PngEffort::kFast ? PNG_IMAGE_FLAG_FAST : 0;
  const std::size_t start = out.size();
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(header.image);
  out.resize(start + size);
  if (png_image_write_to_memory(&header.image, out.data() + start, &size, 0, picture.data,
                                static_cast<png_int_32>(picture.stride), nullptr) == 0) {
    out.resize(start);
    return Error{std::string("a picture cannot be encoded as PNG: ") + header.image.message};
  }
  out.resize(start + size);
  return {};
}

Result<Image8> decode_png(std::span<const std::uint8_t> bytes, std::uint32_t width, std::uint32_t height) {
  Header header;
  if (png_image_begin_read_from_memory(&header.image, bytes.data(), bytes.size()) == 0)
    return Error{std::string("texture is no PNG, or a damaged one: ") + header.image.message};
  if (header.image.width != width || header.image.height != height)
    return Error{"texture is " + std::to_string(header.image.width) + "x" +
                 std::to_string(header.image.height) + ", but the frame declares " + std::to_string(width) +
                 "x" + std::to_string(height)};
  const bool plain = bytes[kFormatAt] == 8 &&
                     (bytes[kFormatAt + 1] == kGrey || bytes[kFormatAt + 1] == kRgb) &&
                     (header.image.format & PNG_FORMAT_FLAG_ALPHA) == 0 &&
                     (header.image.flags & PNG_IMAGE_FLAG_COLORSPACE_NOT_sRGB) == 0;
  if (!plain) return Error{"texture is a PNG of a kind that the format does not allow"};
  header.image.format = PNG_FORMAT_RGB;
  Image8 picture(static_cast<int>(width), static_cast<int>(height), 3);
  if (png_image_finish_read(&header.image, nullptr, picture.data(), static_cast<png_int_32>(picture.stride()),
                            nullptr) == 0)
    return Error{std::string("texture is a damaged PNG: ") + header.image.message};
  if ((header.image.warning_or_error & PNG_IMAGE_WARNING) != 0)
    return Error{std::string("texture is a damaged PNG: ") + header.image.message};
  return picture;
}

}  // namespace relievo
