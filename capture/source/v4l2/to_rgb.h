// SPDX-License-Identifier: Apache-2.0
// Conversions to RGB, one a memory layout: a PixelFormat's to_rgb. Each reads raw.width x raw.height pixels
// of the view and writes as many rows. Only JPEG can fail: where the bytes are damaged or of another size.
//
// Chroma is interpolated along the line (its samples lie on the even pixels), and taken from the nearest
// line. Y'CbCr becomes R'G'B' of the same primaries and transfer function; the rig's colour matrix takes it
// from there.
#pragma once

#include "capture/source/v4l2/pixel_format.h"

namespace relievo::v4l2 {

Status rgb24_to_rgb(const RawView& raw, const RgbRows& out);
Status bgr24_to_rgb(const RawView& raw, const RgbRows& out);
Status yuyv_to_rgb(const RawView& raw, const RgbRows& out);
Status uyvy_to_rgb(const RawView& raw, const RgbRows& out);
Status nv12_to_rgb(const RawView& raw, const RgbRows& out);
Status grey_to_rgb(const RawView& raw, const RgbRows& out);
Status rggb_to_rgb(const RawView& raw, const RgbRows& out);
Status bggr_to_rgb(const RawView& raw, const RgbRows& out);
Status grbg_to_rgb(const RawView& raw, const RgbRows& out);
Status gbrg_to_rgb(const RawView& raw, const RgbRows& out);
Status jpeg_to_rgb(const RawView& raw, const RgbRows& out);

}  // namespace relievo::v4l2
