// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/capture_format.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "capture/source/v4l2/controls.h"
#include "capture/source/v4l2/tv_standard.h"

namespace relievo::v4l2 {
namespace {

constexpr double kRateTolerance = 0.01;  // 30 asked for may be 30000/1001

struct NamedField {
  const char* name;
  std::uint32_t field;
};
constexpr NamedField kFields[] = {{"progressive", V4L2_FIELD_NONE},
                                  {"interlaced", V4L2_FIELD_INTERLACED},
                                  {"seq-tb", V4L2_FIELD_SEQ_TB},
                                  {"seq-bt", V4L2_FIELD_SEQ_BT},
                                  {"alternate", V4L2_FIELD_ALTERNATE}};

std::string field_name(std::uint32_t field) {
  switch (field) {
    case V4L2_FIELD_INTERLACED_TB:
    case V4L2_FIELD_INTERLACED_BT:
      return "interlaced";
    case V4L2_FIELD_TOP:
      return "only the top field";
    case V4L2_FIELD_BOTTOM:
      return "only the bottom field";
    default:
      break;
  }
  for (const NamedField& named : kFields) {
    if (named.field == field) return named.name;
  }
  return "field number " + std::to_string(field);
}

/// Buffers hold half a frame's rows.
bool one_field(std::uint32_t field) {
  return field == V4L2_FIELD_ALTERNATE || field == V4L2_FIELD_TOP || field == V4L2_FIELD_BOTTOM;
}

/// What S_FMT settles, of either API.
struct Settled {
  std::uint32_t fourcc = 0, width = 0, height = 0, field = 0;
  std::uint32_t colorspace = 0, ycbcr_enc = 0, quantization = 0;
  std::uint32_t planes = 1;
  std::array<std::uint32_t, 2> strides{};
};

std::vector<std::uint32_t> fourccs_of(const Device& device) {
  std::vector<std::uint32_t> all;
  v4l2_fmtdesc description{};
  description.type = device.type();
  for (; device.call(VIDIOC_ENUM_FMT, &description) == 0; ++description.index)
    all.push_back(description.pixelformat);
  return all;
}

int exchange(const Device& device, unsigned long request, Settled& s) {
  v4l2_format format{};
  format.type = device.type();
  if (request != VIDIOC_G_FMT) {
    if (device.multiplanar()) {
      v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
      pix.pixelformat = s.fourcc;
      pix.width = s.width;
      pix.height = s.height;
      pix.field = s.field;
    } else {
      v4l2_pix_format& pix = format.fmt.pix;
      pix.pixelformat = s.fourcc;
      pix.width = s.width;
      pix.height = s.height;
      pix.field = s.field;
    }
  }
  if (const int error = device.call(request, &format); error != 0) return error;
  if (device.multiplanar()) {
    const v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
    s = {pix.pixelformat, pix.width,        pix.height,     pix.field, pix.colorspace,
         pix.ycbcr_enc,   pix.quantization, pix.num_planes, {}};
    for (std::size_t i = 0; i < s.strides.size() && i < pix.num_planes; ++i)
      s.strides[i] = pix.plane_fmt[i].bytesperline;
  } else {
    const v4l2_pix_format& pix = format.fmt.pix;
    s = {pix.pixelformat,
         pix.width,
         pix.height,
         pix.field,
         pix.colorspace,
         pix.ycbcr_enc,
         pix.quantization,
         1,
         {pix.bytesperline, pix.bytesperline}};
  }
  return 0;
}

std::string known_among(const std::vector<std::uint32_t>& fourccs, bool known) {
  std::string names;
  for (const std::uint32_t fourcc : fourccs) {
    const PixelFormat* format = pixel_format(fourcc);
    if ((format != nullptr) == known)
      names += (names.empty() ? "" : ", ") + (format ? std::string(format->name) : fourcc_text(fourcc));
  }
  return names.empty() ? "none" : names;
}

Result<const PixelFormat*> choose_pixels(const Device& device, const CameraOptions& options) {
  const std::vector<std::uint32_t> there = fourccs_of(device);
  const auto has = [&](const PixelFormat& format) {
    return std::find(there.begin(), there.end(), format.fourcc) != there.end();
  };
  if (there.empty())
    return Error{device.path() + ": offers no format yet: a loopback device has one once a program feeds it"};
  if (options.format.empty()) {
    for (const PixelFormat& format : pixel_formats()) {
      if (has(format)) return &format;
    }
    return Error{device.path() + ": gives no format that can be read here, only " +
                 known_among(there, false) + "; readable are " + pixel_format_names()};
  }
  const PixelFormat* format = pixel_format(options.format);
  if (format == nullptr)
    return Error{"the format \"" + options.format + "\" cannot be read: give one of " + pixel_format_names()};
  if (!has(*format))
    return Error{device.path() + ": does not give " + options.format + ": give one of " +
                 known_among(there, true)};
  return format;
}

Error not_given(const Device& device, const std::string& what, const std::string& option) {
  return Error{device.path() + ": " + what + ": ask for that with " + option +
               ", or for what relievo-server devices lists"};
}

/// Sets one of the driver's rectangles to its default; true where it was another.
bool reset_selection(const Device& device, std::uint32_t target, std::uint32_t usual_target) {
  v4l2_selection usual{}, now{};
  usual.type = now.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;  // of multi-planar devices too
  usual.target = usual_target;
  now.target = target;
  if (device.call(VIDIOC_G_SELECTION, &usual) != 0 || device.call(VIDIOC_G_SELECTION, &now) != 0)
    return false;
  const v4l2_rect a = usual.r, b = now.r;
  if (a.left == b.left && a.top == b.top && a.width == b.width && a.height == b.height) return false;
  usual.target = target;
  return device.call(VIDIOC_S_SELECTION, &usual) == 0;
}

/// The whole sensor on the whole picture: what was used before may have left another part, which would change
/// the camera's geometry. True where it did.
bool undo_cropping(const Device& device) {
  const bool cropped = reset_selection(device, V4L2_SEL_TGT_CROP, V4L2_SEL_TGT_CROP_DEFAULT);
  return reset_selection(device, V4L2_SEL_TGT_COMPOSE, V4L2_SEL_TGT_COMPOSE_DEFAULT) || cropped;
}

/// S_FMT, and what came of it.
Result<Settled> set_format(const Device& device, const PixelFormat& pixels, const CameraOptions& options) {
  Settled now;
  if (const int error = exchange(device, VIDIOC_G_FMT, now); error != 0)
    return device.refused("say its format", error);
  std::uint32_t field = V4L2_FIELD_ANY;
  if (!options.field.empty()) {
    const auto named = v4l2_field(options.field);
    if (!named)
      return Error{"the field layout \"" + options.field +
                   "\" is not known: give progressive, interlaced, seq-tb, seq-bt or alternate"};
    field = *named;
  }
  const bool alternate = field == V4L2_FIELD_ALTERNATE;
  Settled s;
  s.fourcc = pixels.fourcc;
  s.width = options.width > 0 ? static_cast<std::uint32_t>(options.width) : now.width;
  s.height = options.height > 0 ? static_cast<std::uint32_t>(options.height) : now.height;
  if (options.height <= 0 && one_field(now.field)) s.height *= 2;
  if (alternate) s.height /= 2;
  s.field = field;
  const Settled asked = s;
  if (const int error = exchange(device, VIDIOC_S_FMT, s); error != 0)
    return device.refused("capture " + std::string(pixels.name), error);
  if (undo_cropping(device)) {
    if (const int error = exchange(device, VIDIOC_G_FMT, s); error != 0)
      return device.refused("say its format", error);
  }
  const auto rows = [](const Settled& of) { return of.height * (of.field == V4L2_FIELD_ALTERNATE ? 2 : 1); };
  const auto size = [&](const Settled& of) {
    return std::to_string(of.width) + "x" + std::to_string(rows(of));
  };
  if (s.fourcc != asked.fourcc)
    return not_given(device, "gives " + fourcc_text(s.fourcc) + " instead of " + std::string(pixels.name),
                     "--format");
  const bool interlaced_kind = asked.field == V4L2_FIELD_INTERLACED &&
                               (s.field == V4L2_FIELD_INTERLACED_TB || s.field == V4L2_FIELD_INTERLACED_BT);
  if (asked.field != V4L2_FIELD_ANY && s.field != asked.field && !interlaced_kind)
    return not_given(device, "gives " + field_name(s.field) + " instead of " + options.field + " pictures",
                     "--field");
  if (options.width > 0 && (s.width != asked.width || rows(s) != rows(asked)))
    return not_given(device, "gives " + size(s) + " instead of " + size(asked), "--size");
  return s;
}

Result<CaptureFormat> understand(const Device& device, const PixelFormat& pixels, const Settled& s,
                                 const std::optional<TvTiming>& tv) {
  CaptureFormat format;
  format.pixels = &pixels;
  format.width = static_cast<int>(s.width);
  format.buffer_height = static_cast<int>(s.height);
  if (tv) format.order = tv->order;
  switch (s.field) {
    case V4L2_FIELD_NONE:
      format.layout = FieldLayout::kProgressive;
      break;
    case V4L2_FIELD_INTERLACED:
    case V4L2_FIELD_INTERLACED_TB:
    case V4L2_FIELD_INTERLACED_BT:
      format.layout = FieldLayout::kInterlaced;
      if (s.field != V4L2_FIELD_INTERLACED)
        format.order = s.field == V4L2_FIELD_INTERLACED_TB ? FieldOrder::kTop : FieldOrder::kBottom;
      break;
    case V4L2_FIELD_SEQ_TB:
    case V4L2_FIELD_SEQ_BT:
      // The field in front in memory is the older one.
      format.layout = FieldLayout::kSequential;
      format.top_in_front = s.field == V4L2_FIELD_SEQ_TB;
      format.order = format.top_in_front ? FieldOrder::kTop : FieldOrder::kBottom;
      break;
    case V4L2_FIELD_ALTERNATE:
      format.layout = FieldLayout::kAlternate;
      break;
    default:
      return not_given(device,
                       "gives " + field_name(s.field) + ", which cannot carry a slide and its complement",
                       "--field");
  }
  if (format.layout != FieldLayout::kProgressive && format.layout != FieldLayout::kAlternate &&
      !pixels.fields)
    return Error{device.path() + ": the fields of interlaced " + std::string(pixels.name) +
                 " cannot be told apart: give another --format"};
  if (format.layout != FieldLayout::kProgressive && format.layout != FieldLayout::kAlternate &&
      s.height % (pixels.planes == 2 ? 4 : 2) != 0)
    return not_given(device, "gives " + std::to_string(s.height) + " rows, which are no two whole fields",
                     "--size");
  auto coding = coding_of(s.colorspace, s.ycbcr_enc, s.quantization, pixels.ycbcr);
  if (!coding) return coding.error().in(device.path());
  format.coding = *coding;
  for (std::size_t i = 0; i < s.strides.size(); ++i) format.strides[i] = s.strides[i];
  const std::size_t row = s.width * static_cast<std::size_t>(pixels.bytes_a_pixel);
  if (s.strides[0] < row || s.width == 0 || s.height == 0)
    return Error{device.path() + ": states a picture of " + std::to_string(s.width) + "x" +
                 std::to_string(s.height) + " in rows of " + std::to_string(s.strides[0]) +
                 " bytes, which cannot be"};
  return format;
}

/// Sets the rate where one is asked for, and reads the time from one picture to the next; 0: not known.
Result<std::int64_t> settle_rate(const Device& device, double rate, const std::optional<TvTiming>& tv) {
  std::int64_t picture_ns = 0;
  if (tv) {
    picture_ns = tv->frame_ns;
  } else {
    v4l2_streamparm parameters{};
    parameters.type = device.type();
    if (rate > 0) {
      parameters.parm.capture.timeperframe = {1000, static_cast<__u32>(std::lround(1000 * rate))};
      if (const int error = device.call(VIDIOC_S_PARM, &parameters); error != 0)
        return device.refused("set a rate", error);
    } else if (device.call(VIDIOC_G_PARM, &parameters) != 0) {
      return picture_ns;
    }
    const v4l2_fract& period = parameters.parm.capture.timeperframe;
    if (period.denominator > 0) picture_ns = std::llround(1e9 * period.numerator / period.denominator);
  }
  if (rate > 0 && picture_ns > 0 &&
      std::abs(1e9 / static_cast<double>(picture_ns) / rate - 1) > kRateTolerance) {
    char given[32];
    std::snprintf(given, sizeof given, "%.2f", 1e9 / static_cast<double>(picture_ns));
    return not_given(device, std::string("gives ") + given + " pictures a second at this size", "--rate");
  }
  return picture_ns;
}

}  // namespace

std::optional<std::uint32_t> v4l2_field(const std::string& name) {
  for (const NamedField& named : kFields) {
    if (name == named.name) return named.field;
  }
  return std::nullopt;
}

std::string current_format(const Device& device) {
  Settled now;
  if (exchange(device, VIDIOC_G_FMT, now) != 0) return "";
  const PixelFormat* pixels = pixel_format(now.fourcc);
  const std::uint32_t rows = now.field == V4L2_FIELD_ALTERNATE ? 2 * now.height : now.height;
  return (pixels ? std::string(pixels->name) : fourcc_text(now.fourcc)) + " " + std::to_string(now.width) +
         "x" + std::to_string(rows) + " " + field_name(now.field);
}

Result<CaptureFormat> settle_format(const Device& device, const CameraOptions& options) {
  if (!options.input.empty()) {
    if (const Status set = select_input(device, options.input); !set) return set.error();
  }
  if (!options.standard.empty()) {
    if (const Status set = select_standard(device, options.standard); !set) return set.error();
  }
  auto pixels = choose_pixels(device, options);
  if (!pixels) return pixels.error();
  auto settled = set_format(device, **pixels, options);
  if (!settled) return settled.error();
  const auto tv = tv_timing(device);
  auto format = understand(device, **pixels, *settled, tv);
  if (!format) return format.error();
  auto picture_ns = settle_rate(device, options.rate, tv);
  if (!picture_ns) return picture_ns.error();
  // A driver that knows no rate: what most cameras have, until time stamps tell.
  format->picture_ns = *picture_ns > 0 ? *picture_ns : 33'333'333;
  if (!options.field_order.empty()) {
    if (options.field_order != "top" && options.field_order != "bottom")
      return Error{"the field order \"" + options.field_order + "\" is not known: give top or bottom"};
    format->order = options.field_order == "top" ? FieldOrder::kTop : FieldOrder::kBottom;
  }
  if (const Status set = set_controls(device, options.controls); !set) return set.error();
  return format;
}

}  // namespace relievo::v4l2
