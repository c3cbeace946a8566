// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/pixel_format.h"

#include <linux/videodev2.h>

#include "capture/source/v4l2/to_rgb.h"

namespace relievo::v4l2 {
namespace {

constexpr PixelFormat kFormats[] = {
    {"RGB24", V4L2_PIX_FMT_RGB24, 1, false, 3, false, true, rgb24_to_rgb},
    {"BGR24", V4L2_PIX_FMT_BGR24, 1, false, 3, false, true, bgr24_to_rgb},
    {"YUYV", V4L2_PIX_FMT_YUYV, 1, false, 2, true, true, yuyv_to_rgb},
    {"UYVY", V4L2_PIX_FMT_UYVY, 1, false, 2, true, true, uyvy_to_rgb},
    {"NV12", V4L2_PIX_FMT_NV12, 2, false, 1, true, true, nv12_to_rgb},
    {"NM12", V4L2_PIX_FMT_NV12M, 2, true, 1, true, true, nv12_to_rgb},
    {"SRGGB8", V4L2_PIX_FMT_SRGGB8, 1, false, 1, false, false, rggb_to_rgb},
    {"SBGGR8", V4L2_PIX_FMT_SBGGR8, 1, false, 1, false, false, bggr_to_rgb},
    {"SGRBG8", V4L2_PIX_FMT_SGRBG8, 1, false, 1, false, false, grbg_to_rgb},
    {"SGBRG8", V4L2_PIX_FMT_SGBRG8, 1, false, 1, false, false, gbrg_to_rgb},
    {"MJPEG", V4L2_PIX_FMT_MJPEG, 1, false, 0, false, false, jpeg_to_rgb},
    {"JPEG", V4L2_PIX_FMT_JPEG, 1, false, 0, false, false, jpeg_to_rgb},
    {"GREY", V4L2_PIX_FMT_GREY, 1, false, 1, false, true, grey_to_rgb},
};

}  // namespace

std::span<const PixelFormat> pixel_formats() {
  return kFormats;
}

const PixelFormat* pixel_format(std::uint32_t fourcc) {
  for (const PixelFormat& format : kFormats) {
    if (format.fourcc == fourcc) return &format;
  }
  return nullptr;
}

const PixelFormat* pixel_format(std::string_view name) {
  for (const PixelFormat& format : kFormats) {
    if (format.name == name || fourcc_text(format.fourcc) == name) return &format;
  }
  return nullptr;
}

std::string pixel_format_names() {
  std::string names;
  for (const PixelFormat& format : kFormats) names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (int i = 0; i < 4; ++i) text += static_cast<char>(fourcc >> (8 * i) & 0x7f);
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

}  // namespace relievo::v4l2
