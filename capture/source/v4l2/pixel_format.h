// SPDX-License-Identifier: Apache-2.0
// The pixel formats that can be read, and the one way from any of them to RGB.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"

namespace relievo::v4l2 {

/// How luma and chroma came from R'G'B', as the driver states it.
struct YcbcrCoding {
  double kr = 0.299, kb = 0.114;  // luma's shares of red and blue
  bool full_range = false;        // 0..255 instead of 16..235 (luma, RGB, grey) and 16..240 (chroma)
};

/// One picture, or one field of one, in the driver's memory. A format's planes may lie in one buffer or
/// several.
struct RawView {
  struct Plane {
    const std::uint8_t* data = nullptr;
    std::ptrdiff_t stride = 0;  // bytes
    std::size_t bytes = 0;      // of a compressed picture
  };
  std::array<Plane, 2> planes;
  int width = 0, height = 0;
  YcbcrCoding coding;
};

/// Rows of somebody's RGB picture: a whole one, or one field of it.
struct RgbRows {
  std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;  // bytes from row to row
};

struct PixelFormat {
  std::string_view name;  // as options, devices and messages have it
  std::uint32_t fourcc = 0;
  int planes = 1;         // pictures' own planes
  bool separate = false;  // each in a buffer of its own (multi-planar devices)
  int bytes_a_pixel = 1;  // of the first plane; 0: compressed
  bool ycbcr = false;     // the coding's matrix matters
  bool fields = true;     // rows of two fields can be told apart
  Status (*to_rgb)(const RawView& raw, const RgbRows& out) = nullptr;
};

/// Best first: what is nearest to the sensor's RGB comes before what is packed or compressed.
std::span<const PixelFormat> pixel_formats();
const PixelFormat* pixel_format(std::uint32_t fourcc);
/// By its name, or by the four letters of its code.
const PixelFormat* pixel_format(std::string_view name);
/// "RGB24, BGR24, ...": for messages and help.
std::string pixel_format_names();
/// The four letters of any code, for messages.
std::string fourcc_text(std::uint32_t fourcc);

}  // namespace relievo::v4l2
