// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/describe.h"

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "capture/source/v4l2/capture_format.h"
#include "capture/source/v4l2/pixel_format.h"

namespace relievo::v4l2 {
namespace {

template <std::size_t N>
std::string text(const __u8 (&bytes)[N]) {
  const std::string all(bytes, bytes + N);
  return all.substr(0, all.find('\0'));
}

double rate_of(const v4l2_fract& period) {
  return period.numerator == 0 ? 0 : static_cast<double>(period.denominator) / period.numerator;
}

std::vector<double> rates_of(const Device& device, std::uint32_t fourcc, int width, int height) {
  std::vector<double> rates;
  v4l2_frmivalenum interval{};
  interval.pixel_format = fourcc;
  interval.width = static_cast<__u32>(width);
  interval.height = static_cast<__u32>(height);
  for (; device.call(VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0; ++interval.index) {
    if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates.push_back(rate_of(interval.discrete));
      continue;
    }
    rates.push_back(rate_of(interval.stepwise.max));  // the ends of a range
    rates.push_back(rate_of(interval.stepwise.min));
    break;
  }
  std::sort(rates.begin(), rates.end());
  rates.erase(std::unique(rates.begin(), rates.end()), rates.end());
  return rates;
}

std::vector<SizeRange> sizes_of(const Device& device, std::uint32_t fourcc) {
  std::vector<SizeRange> sizes;
  v4l2_frmsizeenum size{};
  size.pixel_format = fourcc;
  for (; device.call(VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
    const auto number = [](__u32 value) { return static_cast<int>(std::min<__u32>(value, 1 << 20)); };
    SizeRange range;
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      range.least_width = range.most_width = number(size.discrete.width);
      range.least_height = range.most_height = number(size.discrete.height);
    } else {
      const v4l2_frmsize_stepwise& s = size.stepwise;
      range = {number(s.min_width),
               number(s.max_width),
               number(s.step_width),
               number(s.min_height),
               number(s.max_height),
               number(s.step_height),
               {}};
    }
    range.rates = rates_of(device, fourcc, range.most_width, range.most_height);
    sizes.push_back(std::move(range));
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) break;
  }
  return sizes;
}

std::vector<FormatDescription> formats_of(const Device& device) {
  std::vector<FormatDescription> formats;
  v4l2_fmtdesc description{};
  description.type = device.type();
  for (; device.call(VIDIOC_ENUM_FMT, &description) == 0; ++description.index) {
    const PixelFormat* known = pixel_format(description.pixelformat);
    formats.push_back({known ? std::string(known->name) : fourcc_text(description.pixelformat),
                       text(description.description), known != nullptr,
                       sizes_of(device, description.pixelformat)});
  }
  return formats;
}

}  // namespace

std::vector<std::string> device_paths() {
  std::vector<std::pair<int, std::string>> found;
  std::error_code code;
  for (std::filesystem::directory_iterator it("/dev", code), end; !code && it != end; it.increment(code)) {
    const std::string name = it->path().filename().string();
    constexpr std::string_view kPrefix = "video";
    int number = 0;
    if (!name.starts_with(kPrefix)) continue;
    const char* last = name.data() + name.size();
    const auto [at, failed] = std::from_chars(name.data() + kPrefix.size(), last, number);
    if (failed == std::errc() && at == last) found.emplace_back(number, it->path().string());
  }
  std::sort(found.begin(), found.end());
  std::vector<std::string> paths;
  for (auto& [number, path] : found) paths.push_back(std::move(path));
  return paths;
}

Result<DeviceDescription> describe(Io& io, const std::string& path) {
  const auto device = Device::open(io, path);
  if (!device) return device.error();
  DeviceDescription out;
  out.path = path;
  out.label = text(device->capability().card);
  out.driver = text(device->capability().driver);
  out.bus = text(device->capability().bus_info);
  out.multiplanar = device->multiplanar();
  out.now = current_format(*device);
  out.formats = formats_of(*device);
  out.inputs = inputs_of(*device);
  if (const auto input = current_input(*device)) out.current_input = static_cast<int>(input->number);
  v4l2_std_id standards = 0;
  if (device->call(VIDIOC_G_STD, &standards) == 0) out.current_standards = standard_names(standards);
  out.controls = controls_of(*device);
  return out;
}

}  // namespace relievo::v4l2
