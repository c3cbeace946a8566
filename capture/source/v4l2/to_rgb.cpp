// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/to_rgb.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "capture/picture_decode.h"

namespace relievo::v4l2 {
namespace {

constexpr int kShift = 14;

std::uint8_t to_byte(int scaled) {
  return static_cast<std::uint8_t>(std::clamp((scaled + (1 << (kShift - 1))) >> kShift, 0, 255));
}

int scale(double value) {
  return static_cast<int>(std::lround(value * (1 << kShift)));
}

/// value * gain + offset, in fixed point.
struct Range {
  int gain, black;

  explicit Range(bool full) : gain(scale(full ? 1.0 : 255.0 / 219)), black(full ? 0 : 16) {}
  int operator()(int value) const { return (value - black) * gain; }
};

/// The inverse of Y' = kr R' + (1 - kr - kb) G' + kb B', Pb = (B' - Y') / 2 (1 - kb), Pr likewise.
class Matrix {
 public:
  explicit Matrix(const YcbcrCoding& c) : luma_(c.full_range) {
    const double chroma = c.full_range ? 1.0 : 255.0 / 224;
    const double kg = 1 - c.kr - c.kb;
    red_cr_ = scale(chroma * 2 * (1 - c.kr));
    blue_cb_ = scale(chroma * 2 * (1 - c.kb));
    green_cb_ = scale(chroma * 2 * (1 - c.kb) * c.kb / kg);
    green_cr_ = scale(chroma * 2 * (1 - c.kr) * c.kr / kg);
  }
  /// Chroma doubled, so that the mean of two samples is whole: cb2 = 2 (Cb - 128).
  void pixel(int y, int cb2, int cr2, std::uint8_t* rgb) const {
    const int base = luma_(y);
    rgb[0] = to_byte(base + ((cr2 * red_cr_) >> 1));
    rgb[1] = to_byte(base - ((cb2 * green_cb_ + cr2 * green_cr_) >> 1));
    rgb[2] = to_byte(base + ((cb2 * blue_cb_) >> 1));
  }

 private:
  Range luma_;
  int red_cr_, blue_cb_, green_cb_, green_cr_;
};

/// One line whose chroma samples lie on the even pixels; each pointer steps by its own number of bytes.
struct ChromaLine {
  const std::uint8_t *y, *cb, *cr;
  int y_step, chroma_step;
};

void convert_line(const ChromaLine& in, int width, const Matrix& matrix, std::uint8_t* out) {
  const int pairs = (width + 1) / 2;
  for (int pair = 0; pair < pairs; ++pair) {
    const int at = pair * in.chroma_step;
    const int after = std::min(pair + 1, pairs - 1) * in.chroma_step;
    const int cb = in.cb[at] - 128, cr = in.cr[at] - 128;
    const int x = 2 * pair;
    matrix.pixel(in.y[x * in.y_step], 2 * cb, 2 * cr, out + 3 * x);
    if (x + 1 == width) return;
    matrix.pixel(in.y[(x + 1) * in.y_step], cb + in.cb[after] - 128, cr + in.cr[after] - 128,
                 out + 3 * (x + 1));
  }
}

const std::uint8_t* row_of(const RawView::Plane& plane, int y) {
  return plane.data + y * plane.stride;
}

/// 4:2:2 in one plane: where the first luma and the two chroma bytes of four lie.
Status packed_to_rgb(const RawView& raw, const RgbRows& out, int y_at, int cb_at, int cr_at) {
  const Matrix matrix(raw.coding);
  for (int y = 0; y < raw.height; ++y) {
    const std::uint8_t* row = row_of(raw.planes[0], y);
    convert_line({row + y_at, row + cb_at, row + cr_at, 2, 4}, raw.width, matrix, out.data + y * out.stride);
  }
  return {};
}

/// Three bytes a pixel; `red` and `blue` are their places.
Status bytes_to_rgb(const RawView& raw, const RgbRows& out, int red, int blue) {
  const Range range(raw.coding.full_range);
  for (int y = 0; y < raw.height; ++y) {
    const std::uint8_t* in = row_of(raw.planes[0], y);
    std::uint8_t* rgb = out.data + y * out.stride;
    if (raw.coding.full_range && red == 0) {
      std::copy_n(in, 3 * raw.width, rgb);
      continue;
    }
    for (int x = 0; x < raw.width; ++x, in += 3, rgb += 3) {
      const int r = in[red], g = in[1], b = in[blue];
      rgb[0] = to_byte(range(r));
      rgb[1] = to_byte(range(g));
      rgb[2] = to_byte(range(b));
    }
  }
  return {};
}

/// OpenCV's bilinear demosaicing; `code` is one of its conversions.
Status bayer_to_rgb(const RawView& raw, const RgbRows& out, int code) {
  // OpenCV's Mat has no constant form; the input is only read.
  const cv::Mat in(raw.height, raw.width, CV_8UC1, const_cast<std::uint8_t*>(raw.planes[0].data),
                   static_cast<std::size_t>(raw.planes[0].stride));
  cv::Mat rgb(raw.height, raw.width, CV_8UC3, out.data, static_cast<std::size_t>(out.stride));
  cv::cvtColor(in, rgb, code);
  if (raw.coding.full_range) return {};
  const Range range(false);
  for (int y = 0; y < raw.height; ++y) {
    std::uint8_t* row = out.data + y * out.stride;
    for (int x = 0; x < 3 * raw.width; ++x) row[x] = to_byte(range(row[x]));
  }
  return {};
}

}  // namespace

Status rgb24_to_rgb(const RawView& raw, const RgbRows& out) {
  return bytes_to_rgb(raw, out, 0, 2);
}
Status bgr24_to_rgb(const RawView& raw, const RgbRows& out) {
  return bytes_to_rgb(raw, out, 2, 0);
}
Status yuyv_to_rgb(const RawView& raw, const RgbRows& out) {
  return packed_to_rgb(raw, out, 0, 1, 3);
}
Status uyvy_to_rgb(const RawView& raw, const RgbRows& out) {
  return packed_to_rgb(raw, out, 1, 0, 2);
}

Status nv12_to_rgb(const RawView& raw, const RgbRows& out) {
  const Matrix matrix(raw.coding);
  for (int y = 0; y < raw.height; ++y) {
    const std::uint8_t* chroma = row_of(raw.planes[1], y / 2);
    convert_line({row_of(raw.planes[0], y), chroma, chroma + 1, 1, 2}, raw.width, matrix,
                 out.data + y * out.stride);
  }
  return {};
}

Status grey_to_rgb(const RawView& raw, const RgbRows& out) {
  const Range range(raw.coding.full_range);
  for (int y = 0; y < raw.height; ++y) {
    const std::uint8_t* in = row_of(raw.planes[0], y);
    std::uint8_t* rgb = out.data + y * out.stride;
    for (int x = 0; x < raw.width; ++x) std::fill_n(rgb + 3 * x, 3, to_byte(range(in[x])));
  }
  return {};
}

Status rggb_to_rgb(const RawView& raw, const RgbRows& out) {
  return bayer_to_rgb(raw, out, cv::COLOR_BayerRGGB2RGB);
}
Status bggr_to_rgb(const RawView& raw, const RgbRows& out) {
  return bayer_to_rgb(raw, out, cv::COLOR_BayerBGGR2RGB);
}
Status grbg_to_rgb(const RawView& raw, const RgbRows& out) {
  return bayer_to_rgb(raw, out, cv::COLOR_BayerGRBG2RGB);
}
Status gbrg_to_rgb(const RawView& raw, const RgbRows& out) {
  return bayer_to_rgb(raw, out, cv::COLOR_BayerGBRG2RGB);
}

Status jpeg_to_rgb(const RawView& raw, const RgbRows& out) {
  const RawView::Plane& plane = raw.planes[0];
  const Status decoded = decode_jpeg({plane.data, plane.bytes}, raw.width, raw.height, out.data,
                                     static_cast<std::ptrdiff_t>(out.stride));
  if (!decoded) return Error{"a JPEG " + decoded.error().message};
  return {};
}

}  // namespace relievo::v4l2
