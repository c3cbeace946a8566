// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/raw_picture.h"

namespace relievo::v4l2 {
namespace {

/// The format's planes in the buffer: of formats that are not separate the second follows the first.
Result<RawView> whole_view(const Filled& filled, const CaptureFormat& format) {
  const PixelFormat& pixels = *format.pixels;
  RawView view;
  view.width = format.width;
  view.height = format.buffer_height;
  view.coding = format.coding;
  view.planes[0] = {filled.planes[0].data, format.strides[0], filled.planes[0].used};
  if (pixels.bytes_a_pixel == 0) {
    if (filled.planes[0].used == 0) return Error{"an empty buffer"};
    return view;
  }
  const auto rows = static_cast<std::size_t>(view.height);
  const auto stride = static_cast<std::size_t>(format.strides[0]);
  // Of two planes 4:2:0, each pair of rows shares a row of chroma of the same width in bytes.
  const std::size_t row =
      static_cast<std::size_t>(view.width) * static_cast<std::size_t>(pixels.bytes_a_pixel);
  const std::size_t chroma_row = static_cast<std::size_t>(view.width + 1) / 2 * 2;
  std::size_t needed[2] = {stride * (rows - 1) + row, 0};
  if (pixels.planes == 2) {
    const std::size_t chroma_rows = (rows + 1) / 2;
    const auto chroma_stride = pixels.separate ? static_cast<std::size_t>(format.strides[1]) : stride;
    const std::size_t chroma = chroma_stride * (chroma_rows - 1) + chroma_row;
    if (pixels.separate) {
      needed[1] = chroma;
      view.planes[1].data = filled.planes[1].data;
    } else {
      needed[0] = stride * rows + chroma;
      view.planes[1].data = filled.planes[0].data + stride * rows;
    }
    view.planes[1].stride = static_cast<std::ptrdiff_t>(chroma_stride);
  }
  if (filled.planes[0].used < needed[0] || filled.planes[1].used < needed[1])
    return Error{"a buffer of " + std::to_string(filled.planes[0].used) + " bytes where a picture has " +
                 std::to_string(needed[0])};
  return view;
}

/// Rows first, first + step, ... of every plane; `height` of them in the first.
RawView rows_of(const RawView& whole, int first, int step, int height) {
  RawView part = whole;
  part.height = height;
  for (std::size_t i = 0; i < part.planes.size(); ++i) {
    RawView::Plane& plane = part.planes[i];
    if (plane.data == nullptr) continue;
    plane.data += (i == 0 || step == 2 ? first : first / 2) * plane.stride;
    plane.stride *= step;
  }
  return part;
}

RgbRows field_rows(Image8& picture, int first) {
  return {picture.row(first), 2 * picture.stride()};
}

}  // namespace

Status write_picture(const Filled& filled, const CaptureFormat& format, const Place& place) {
  const auto view = whole_view(filled, format);
  if (!view) return view.error();
  Image8& out = *place.picture;
  const auto convert = format.pixels->to_rgb;
  if (place.one_field) return convert(*view, field_rows(out, place.first_row));
  if (format.layout == FieldLayout::kProgressive) return convert(*view, {out.data(), out.stride()});
  for (int field = 0; field < 2; ++field) {
    const int height = (view->height + 1 - field) / 2;
    const bool in_front = (field == 0) == format.top_in_front;
    const RawView rows = format.layout == FieldLayout::kInterlaced
                             ? rows_of(*view, field, 2, height)
                             : rows_of(*view, in_front ? 0 : view->height / 2, 1, height);
    if (const Status done = convert(rows, field_rows(out, field)); !done) return done;
  }
  return {};
}

}  // namespace relievo::v4l2
