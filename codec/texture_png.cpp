// SPDX-License-Identifier: Apache-2.0
#include "codec/texture_png.h"

#include <png.h>

#include <cstring>
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

Status append_grey16_png(std::span<const std::uint16_t> pixels, int width, int height, Bytes& out) {
  if (width < 1 || height < 1 ||
      pixels.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    return Error{"a picture for a PNG is empty or not of its size"};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const auto append = [](png_structp to, png_bytep data, png_size_t size) {
    static_cast<Bytes*>(png_get_io_ptr(to))
        ->insert(static_cast<Bytes*>(png_get_io_ptr(to))->end(), data, data + size);
  };
  const std::size_t start = out.size();
  // libpng leaves by longjmp: nothing between here and there has a destructor.
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    out.resize(start);
    return Error{"a picture cannot be encoded as PNG"};
  }
  png_set_write_fn(png, &out, append, nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), 16,
               PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  png_set_swap(png);  // PNG is big endian
  for (int row = 0; row < height; ++row)
    png_write_row(png, reinterpret_cast<png_const_bytep>(
                           pixels.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(width)));
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
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
