// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/tv_standard.h"

#include <algorithm>
#include <cctype>

namespace relievo::v4l2 {
namespace {

struct Standard {
  const char* name;
  std::uint64_t set;
};

constexpr Standard kStandards[] = {
    {"NTSC", V4L2_STD_NTSC},           {"PAL", V4L2_STD_PAL},
    {"SECAM", V4L2_STD_SECAM},         {"NTSC-M", V4L2_STD_NTSC_M},
    {"NTSC-M-JP", V4L2_STD_NTSC_M_JP}, {"NTSC-M-KR", V4L2_STD_NTSC_M_KR},
    {"NTSC-443", V4L2_STD_NTSC_443},   {"PAL-B", V4L2_STD_PAL_B},
    {"PAL-B1", V4L2_STD_PAL_B1},       {"PAL-G", V4L2_STD_PAL_G},
    {"PAL-H", V4L2_STD_PAL_H},         {"PAL-I", V4L2_STD_PAL_I},
    {"PAL-D", V4L2_STD_PAL_D},         {"PAL-D1", V4L2_STD_PAL_D1},
    {"PAL-K", V4L2_STD_PAL_K},         {"PAL-M", V4L2_STD_PAL_M},
    {"PAL-N", V4L2_STD_PAL_N},         {"PAL-Nc", V4L2_STD_PAL_Nc},
    {"PAL-60", V4L2_STD_PAL_60},       {"SECAM-B", V4L2_STD_SECAM_B},
    {"SECAM-D", V4L2_STD_SECAM_D},     {"SECAM-G", V4L2_STD_SECAM_G},
    {"SECAM-H", V4L2_STD_SECAM_H},     {"SECAM-K", V4L2_STD_SECAM_K},
    {"SECAM-K1", V4L2_STD_SECAM_K1},   {"SECAM-L", V4L2_STD_SECAM_L},
    {"SECAM-Lc", V4L2_STD_SECAM_LC},
};

bool same_name(const std::string& a, const std::string& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

std::string text(const __u8* bytes, std::size_t size) {
  const std::string all(bytes, bytes + size);
  return all.substr(0, all.find('\0'));
}

std::string trouble_of(std::uint32_t status) {
  if ((status & V4L2_IN_ST_NO_POWER) != 0) return "no power";
  if ((status & V4L2_IN_ST_NO_SIGNAL) != 0) return "no signal";
  if ((status & (V4L2_IN_ST_NO_SYNC | V4L2_IN_ST_NO_H_LOCK | V4L2_IN_ST_NO_V_LOCK)) != 0)
    return "no steady signal";
  return "";
}

std::optional<Input> input_at(const Device& device, std::uint32_t number) {
  v4l2_input raw{};
  raw.index = number;
  if (device.call(VIDIOC_ENUMINPUT, &raw) != 0) return std::nullopt;
  return Input{number, text(raw.name, sizeof raw.name), raw.std, trouble_of(raw.status)};
}

std::string list(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

}  // namespace

std::vector<Input> inputs_of(const Device& device) {
  std::vector<Input> inputs;
  for (std::uint32_t number = 0; auto input = input_at(device, number); ++number) inputs.push_back(*input);
  return inputs;
}

std::optional<Input> current_input(const Device& device) {
  int number = 0;
  if (device.call(VIDIOC_G_INPUT, &number) != 0 || number < 0) return std::nullopt;
  return input_at(device, static_cast<std::uint32_t>(number));
}

Status select_input(const Device& device, const std::string& wanted) {
  std::vector<std::string> names;
  for (const Input& input : inputs_of(device)) {
    names.push_back(std::to_string(input.number) + " (" + input.name + ")");
    if (wanted != std::to_string(input.number) && !same_name(wanted, input.name)) continue;
    int number = static_cast<int>(input.number);
    if (const int error = device.call(VIDIOC_S_INPUT, &number); error != 0)
      return device.refused("select the input " + names.back(), error);
    return {};
  }
  if (names.empty()) return Error{device.path() + ": has no inputs to choose from: leave --input out"};
  return Error{device.path() + ": has no input \"" + wanted + "\": give " + list(names)};
}

std::vector<std::string> standard_names(std::uint64_t set) {
  std::vector<std::string> names;
  for (const Standard& standard : kStandards) {
    if ((standard.set & ~set) == 0) names.push_back(standard.name);
  }
  return names;
}

Status select_standard(const Device& device, const std::string& wanted) {
  const auto input = current_input(device);
  if (!input || input->standards == 0)
    return Error{device.path() +
                 ": its input takes no TV standard: leave --standard out, or choose another "
                 "--input"};
  v4l2_std_id chosen = 0;
  if (same_name(wanted, "auto")) {
    if (const int error = device.call(VIDIOC_QUERYSTD, &chosen); error != 0 || chosen == 0)
      return Error{device.path() + ": detects no TV standard: is the camera on? Or give --standard"};
    chosen &= input->standards;
  } else {
    for (const Standard& standard : kStandards) {
      if (same_name(wanted, standard.name)) chosen = standard.set & input->standards;
    }
  }
  if (chosen == 0)
    return Error{device.path() + ": does not take the TV standard \"" + wanted + "\": give auto or one of " +
                 list(standard_names(input->standards))};
  if (const int error = device.call(VIDIOC_S_STD, &chosen); error != 0)
    return device.refused("set the TV standard " + wanted, error);
  return {};
}

std::optional<TvTiming> tv_timing(const Device& device) {
  const auto input = current_input(device);
  v4l2_std_id set = 0;
  if (!input || input->standards == 0 || device.call(VIDIOC_G_STD, &set) != 0 || set == 0)
    return std::nullopt;
  // 525 lines: 30000/1001 frames a second. V4L2: M/NTSC sends the bottom field first, all others the top one.
  if ((set & V4L2_STD_525_60) != 0) {
    const bool ntsc = (set & V4L2_STD_NTSC) != 0;
    return TvTiming{33'366'667, ntsc ? FieldOrder::kBottom : FieldOrder::kTop};
  }
  return TvTiming{40'000'000, FieldOrder::kTop};
}

}  // namespace relievo::v4l2
