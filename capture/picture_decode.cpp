// SPDX-License-Identifier: Apache-2.0
#include "capture/picture_decode.h"

#include <png.h>
#include <turbojpeg.h>

#include <csetjmp>
#include <cstring>
#include <memory>
#include <string>

namespace relievo {
namespace {

struct PngInput {
  std::span<const std::uint8_t> left;
  std::string trouble;
};

void read_bytes(png_structp png, png_bytep to, png_size_t count) {
  auto& input = *static_cast<PngInput*>(png_get_io_ptr(png));
  if (count > input.left.size()) png_error(png, "it ends too early");
  std::memcpy(to, input.left.data(), count);
  input.left = input.left.subspan(count);
}

void note_error(png_structp png, png_const_charp what) {
  static_cast<PngInput*>(png_get_error_ptr(png))->trouble = what;
  png_longjmp(png, 1);
}

void ignore(png_structp, png_const_charp) {}  // of colour profiles, say, which are not used

/// False where `input.trouble` says why not. libpng jumps: nothing here may have a destructor.
bool read_rows(png_structp png, png_infop info, PngInput& input, Image8& out) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_read_fn(png, &input, read_bytes);
  png_read_info(png, info);
  png_set_expand(png);
  png_set_strip_16(png);
  png_set_strip_alpha(png);
  if ((png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) == 0) png_set_gray_to_rgb(png);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  out = Image8(static_cast<int>(png_get_image_width(png, info)),
               static_cast<int>(png_get_image_height(png, info)), 3);
  if (png_get_rowbytes(png, info) != static_cast<png_size_t>(out.stride()))
    png_error(png, "its pixels are no RGB");
  for (int pass = 0; pass < passes; ++pass)
    for (int y = 0; y < out.height(); ++y) png_read_row(png, out.row(y), nullptr);
  png_read_end(png, nullptr);
  return true;
}

/// Of one picture. A damaged one leaves libjpeg-turbo 2.1.5 in the middle of it, for good.
class JpegDecoder {
 public:
  explicit JpegDecoder(std::span<const std::uint8_t> file) : file_(file) {}

  Result<JpegSize> size() const {
    JpegSize out{};
    int subsampling = 0, colours = 0;
    if (!turbo_) return Error{"cannot be decoded: memory is short"};
    if (tjDecompressHeader3(turbo_.get(), file_.data(), file_.size(), &out.width, &out.height, &subsampling,
                            &colours) != 0)
      return damaged();
    return out;
  }

  Status decode(JpegSize size, std::uint8_t* rgb, std::ptrdiff_t stride) const {
    if (!turbo_) return Error{"cannot be decoded: memory is short"};
    if (tjDecompress2(turbo_.get(), file_.data(), file_.size(), rgb, size.width, static_cast<int>(stride),
                      size.height, TJPF_RGB, TJFLAG_ACCURATEDCT) == 0)
      return {};
    // A warning is damage too, the rest of such a picture is grey; but for bytes too many between the parts
    // of a file, which many cameras write.
    const bool is_warning = tjGetErrorCode(turbo_.get()) == TJERR_WARNING;
    if (is_warning && std::strstr(tjGetErrorStr2(turbo_.get()), "extraneous bytes") != nullptr) return {};
    return damaged();
  }

 private:
  struct Close {
    void operator()(void* handle) const { tjDestroy(handle); }
  };
  Error damaged() const { return Error{std::string("is damaged: ") + tjGetErrorStr2(turbo_.get())}; }

  const std::span<const std::uint8_t> file_;
  const std::unique_ptr<void, Close> turbo_{tjInitDecompress()};
};

}  // namespace

Result<Image8> decode_png(std::span<const std::uint8_t> file) {
  PngInput input{file, {}};
  Image8 out;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &input, note_error, ignore);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool read = info != nullptr && read_rows(png, info, input, out);
  png_destroy_read_struct(&png, &info, nullptr);
  if (!read) return Error{"is damaged: " + (input.trouble.empty() ? "memory is short" : input.trouble)};
  return out;
}

Result<JpegSize> jpeg_size(std::span<const std::uint8_t> file) {
  return JpegDecoder(file).size();
}

Status decode_jpeg(std::span<const std::uint8_t> file, JpegSize size, std::uint8_t* rgb,
                   std::ptrdiff_t stride) {
  return JpegDecoder(file).decode(size, rgb, stride);
}

Result<Image8> decode_jpeg(std::span<const std::uint8_t> file) {
  const auto size = jpeg_size(file);
  if (!size) return size.error();
  Image8 out(size->width, size->height, 3);
  if (const Status done = decode_jpeg(file, *size, out.data(), out.stride()); !done) return done.error();
  return out;
}

}  // namespace relievo
