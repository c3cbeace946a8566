// SPDX-License-Identifier: Apache-2.0
// Settles with the driver what is captured: input, TV standard, pixel format, size, fields, rate.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rig.h"
#include "capture/source/camera_options.h"
#include "capture/source/v4l2/device.h"
#include "capture/source/v4l2/pixel_format.h"

namespace relievo::v4l2 {

/// How the exposures lie in the driver's buffers.
enum class FieldLayout {
  kProgressive,  // one exposure a buffer
  kInterlaced,   // two fields, row by row
  kSequential,   // two fields, one behind the other, the one exposed first in front unless order says bottom
  kAlternate,    // one field a buffer
};

/// "progressive", "interlaced", ... as CameraOptions::field has them, and the V4L2 field to ask for.
std::optional<std::uint32_t> v4l2_field(const std::string& name);

struct CaptureFormat {
  const PixelFormat* pixels = nullptr;
  int width = 0;
  int buffer_height = 0;  // rows in one buffer: half a frame's where fields alternate
  FieldLayout layout = FieldLayout::kProgressive;
  bool top_in_front = true;             // kSequential: the top field's rows come first in memory
  FieldOrder order = FieldOrder::kTop;  // the field that is exposed first
  std::int64_t picture_ns = 0;  // from one picture (an interlaced frame, a progressive picture) to the next
  std::array<std::ptrdiff_t, 2> strides{};  // bytes a row, of each of the driver's planes
  YcbcrCoding coding;

  Scan scan() const { return layout == FieldLayout::kProgressive ? Scan::kProgressive : Scan::kInterlaced; }
  int frame_height() const { return layout == FieldLayout::kAlternate ? 2 * buffer_height : buffer_height; }
  /// Frames (field pairs) a second.
  double frame_rate() const {
    return (scan() == Scan::kProgressive ? 0.5e9 : 1e9) / static_cast<double>(picture_ns);
  }
};

/// Sets everything that the options name, and reads back what the driver made of it; anything else than what
/// was asked for is an error that says what there is. A frame of the size of `options`.
Result<CaptureFormat> settle_format(const Device& device, const CameraOptions& options);

/// What is set now, for people: "YUYV 640x480 progressive"; empty where the driver does not say.
std::string current_format(const Device& device);

/// What the driver's statements about colours mean; an error where they mean nothing that is known.
Result<YcbcrCoding> coding_of(std::uint32_t colorspace, std::uint32_t ycbcr_enc, std::uint32_t quantization,
                              bool ycbcr);

}  // namespace relievo::v4l2
