// SPDX-License-Identifier: Apache-2.0
#include "capture/picture_decode.h"

// libjpeg's headers want this first
#include <cstdio>

#include <jerror.h>
#include <jpeglib.h>
#include <png.h>

#include <csetjmp>
#include <cstring>
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

struct JpegWatch {
  jpeg_error_mgr errors;  // first: libjpeg knows no other
  std::jmp_buf back;
  char trouble[JMSG_LENGTH_MAX] = "memory is short";
};

void leave_jpeg(j_common_ptr jpeg) {
  auto* const watch = reinterpret_cast<JpegWatch*>(jpeg->err);
  jpeg->err->format_message(jpeg, watch->trouble);
  std::longjmp(watch->back, 1);
}

/// A warning is damage too, the rest of such a picture is grey; but for bytes too many between the parts of a
/// file, which many cameras write.
void judge_jpeg(j_common_ptr jpeg, int level) {
  if (level < 0 && jpeg->err->msg_code != JWRN_EXTRANEOUS_DATA) leave_jpeg(jpeg);
}

/// One picture. libjpeg jumps out of the functions that are false then: nothing in them may have a
/// destructor.
class JpegDecoder {
 public:
  explicit JpegDecoder(std::span<const std::uint8_t> file) : file_(file) {
    jpeg_.err = jpeg_std_error(&watch_.errors);
    watch_.errors.error_exit = leave_jpeg;
    watch_.errors.emit_message = judge_jpeg;
  }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;
  ~JpegDecoder() { jpeg_destroy_decompress(&jpeg_); }

  bool read_head() {
    if (setjmp(watch_.back) != 0) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_mem_src(&jpeg_, file_.data(), file_.size());
    jpeg_read_header(&jpeg_, TRUE);
    return true;
  }
  bool read_rows(std::uint8_t* rgb, std::ptrdiff_t stride) {
    if (setjmp(watch_.back) != 0) return false;
    jpeg_.out_color_space = JCS_RGB;
    jpeg_start_decompress(&jpeg_);
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = rgb + static_cast<std::ptrdiff_t>(jpeg_.output_scanline) * stride;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return true;
  }

  /// Once the head was read.
  int width() const { return static_cast<int>(jpeg_.image_width); }
  int height() const { return static_cast<int>(jpeg_.image_height); }
  Error damage() const { return Error{std::string("is damaged: ") + watch_.trouble}; }

 private:
  const std::span<const std::uint8_t> file_;
  jpeg_decompress_struct jpeg_{};
  JpegWatch watch_{};
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

Result<Image8> decode_jpeg(std::span<const std::uint8_t> file) {
  JpegDecoder jpeg(file);
  if (!jpeg.read_head()) return jpeg.damage();
  Image8 out(jpeg.width(), jpeg.height(), 3);
  if (!jpeg.read_rows(out.data(), out.stride())) return jpeg.damage();
  return out;
}

Status decode_jpeg(std::span<const std::uint8_t> file, int width, int height, std::uint8_t* rgb,
                   std::ptrdiff_t stride) {
  JpegDecoder jpeg(file);
  if (!jpeg.read_head()) return jpeg.damage();
  if (jpeg.width() != width || jpeg.height() != height) {
    const auto text = [](int w, int h) { return std::to_string(w) + "x" + std::to_string(h); };
    return Error{"is " + text(jpeg.width(), jpeg.height()) + " instead of " + text(width, height)};
  }
  if (!jpeg.read_rows(rgb, stride)) return jpeg.damage();
  return {};
}

}  // namespace relievo
