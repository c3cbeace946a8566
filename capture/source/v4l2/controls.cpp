// SPDX-License-Identifier: Apache-2.0
#include "capture/source/v4l2/controls.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <optional>

namespace relievo::v4l2 {
namespace {

/// "Exposure Time, Absolute" -> "exposure_time_absolute".
std::string plain_name(std::string_view label) {
  std::string name;
  for (const char c : label) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

std::string_view kind_of(std::uint32_t type) {
  switch (type) {
    case V4L2_CTRL_TYPE_INTEGER:
    case V4L2_CTRL_TYPE_INTEGER64:
      return "integer";
    case V4L2_CTRL_TYPE_BOOLEAN:
      return "boolean";
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
      return "menu";
    case V4L2_CTRL_TYPE_BUTTON:
      return "button";
    case V4L2_CTRL_TYPE_BITMASK:
      return "bitmask";
    case V4L2_CTRL_TYPE_STRING:
      return "text";
    default:
      return "";
  }
}

std::vector<MenuItem> menu_of(const Device& device, const v4l2_query_ext_ctrl& query) {
  std::vector<MenuItem> items;
  for (std::int64_t value = query.minimum; value <= query.maximum; ++value) {
    v4l2_querymenu item{};
    item.id = query.id;
    item.index = static_cast<__u32>(value);
    if (device.call(VIDIOC_QUERYMENU, &item) != 0) continue;  // menus may have gaps
    if (query.type == V4L2_CTRL_TYPE_INTEGER_MENU) {
      items.push_back({value, std::to_string(item.value)});
    } else {
      const std::string name(item.name, item.name + sizeof item.name);
      items.push_back({value, name.substr(0, name.find('\0'))});
    }
  }
  return items;
}

void read_value(const Device& device, const v4l2_query_ext_ctrl& query, Control& control) {
  if (control.kind == "button" || (query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0) return;
  v4l2_ext_control one{};
  one.id = query.id;
  std::string text;
  if (control.kind == "text") {
    text.resize(static_cast<std::size_t>(query.elem_size));
    one.size = query.elem_size;
    one.string = text.data();
  }
  v4l2_ext_controls all{};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  if (device.call(VIDIOC_G_EXT_CTRLS, &all) != 0) return;
  control.value = query.type == V4L2_CTRL_TYPE_INTEGER64 ? one.value64 : one.value;
  control.text = text.substr(0, text.find('\0'));
}

std::string range(const Control& control) {
  if (control.kind == "menu") {
    std::string items;
    for (const MenuItem& item : control.menu)
      items += (items.empty() ? "" : ", ") + std::to_string(item.value) + " (" + item.name + ")";
    return items;
  }
  if (control.kind == "boolean") return "0 or 1";
  if (control.kind == "button") return "press";
  if (control.kind == "text")
    return std::to_string(control.least) + " to " + std::to_string(control.most) + " characters";
  if (control.kind == "bitmask") return "a number of bits within " + std::to_string(control.most);
  return std::to_string(control.least) + " to " + std::to_string(control.most) +
         (control.step > 1 ? " in steps of " + std::to_string(control.step) : "");
}

std::optional<std::int64_t> number_in(const std::string& text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The number that `text` means to this control, where it takes it.
std::optional<std::int64_t> value_in(const Control& control, const std::string& text) {
  if (control.kind == "button") return 0;
  if (control.kind == "boolean") {
    if (text == "1" || text == "true" || text == "on") return 1;
    if (text == "0" || text == "false" || text == "off") return 0;
    return std::nullopt;
  }
  if (control.kind == "menu") {
    for (const MenuItem& item : control.menu) {
      if (std::to_string(item.value) == text || plain_name(item.name) == plain_name(text)) return item.value;
    }
    return std::nullopt;
  }
  const auto value = number_in(text);
  if (!value || *value < control.least || *value > control.most) return std::nullopt;
  if (control.step > 1 && (*value - control.least) % control.step != 0) return std::nullopt;
  return value;
}

Status set_control(const Device& device, const Control& control, const std::string& text) {
  const std::string whole = "set " + control.name + "=" + text;
  if (control.read_only) return Error{device.path() + ": " + control.name + " can only be read"};
  v4l2_ext_control one{};
  one.id = control.id;
  std::string buffer = text;
  if (control.kind == "text") {
    if (static_cast<std::int64_t>(text.size()) > control.most)
      return Error{device.path() + ": " + control.name + " takes " + range(control)};
    one.size = static_cast<__u32>(control.most + 1);
    buffer.resize(one.size, '\0');
    one.string = buffer.data();
  } else {
    const auto value = value_in(control, text);
    if (!value)
      return Error{device.path() + ": " + control.name + " does not take \"" + text + "\": give " +
                   range(control)};
    if (control.wide) {
      one.value64 = *value;
    } else {
      one.value = static_cast<__s32>(*value);
    }
  }
  v4l2_ext_controls all{};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  const int error = device.call(VIDIOC_S_EXT_CTRLS, &all);
  if (error == 0) return {};
  if (control.inactive)
    return Error{device.path() + ": " + control.name +
                 " is not active: switch its automatic off before it, for example --control auto_exposure=1"};
  return device.refused(whole, error);
}

}  // namespace

std::vector<Control> controls_of(const Device& device) {
  std::vector<Control> controls;
  v4l2_query_ext_ctrl query{};
  query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
  for (; device.call(VIDIOC_QUERY_EXT_CTRL, &query) == 0; query.id |= V4L2_CTRL_FLAG_NEXT_CTRL) {
    const std::string_view kind = kind_of(query.type);
    if (kind.empty() || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0 || query.nr_of_dims > 0) continue;
    Control control;
    control.id = query.id;
    const std::string label(query.name, query.name + sizeof query.name);
    control.label = label.substr(0, label.find('\0'));
    control.name = plain_name(control.label);
    control.kind = kind;
    control.least = query.minimum;
    control.most = query.maximum;
    control.step = static_cast<std::int64_t>(query.step);
    control.usual = query.default_value;
    control.read_only = (query.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0;
    control.inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
    control.wide = query.type == V4L2_CTRL_TYPE_INTEGER64;
    if (kind == "menu") control.menu = menu_of(device, query);
    read_value(device, query, control);
    const auto same = std::count_if(controls.begin(), controls.end(), [&](const Control& other) {
      return plain_name(other.label) == control.name;
    });
    if (same > 0) control.name += "_" + std::to_string(same + 1);
    controls.push_back(std::move(control));
  }
  return controls;
}

Status set_controls(const Device& device, const std::vector<CameraControl>& wanted) {
  for (const CameraControl& want : wanted) {
    // Anew each time: one control may make another active, or change its range.
    const std::vector<Control> controls = controls_of(device);
    const auto found = std::find_if(controls.begin(), controls.end(), [&](const Control& control) {
      return control.name == want.name || control.label == want.name;
    });
    if (found == controls.end()) {
      std::string names;
      for (const Control& control : controls) names += (names.empty() ? "" : ", ") + control.name;
      return Error{device.path() + ": has no control \"" + want.name + "\"" +
                   (names.empty() ? "; it has none at all" : ": give one of " + names)};
    }
    if (const Status set = set_control(device, *found, want.value); !set) return set;
  }
  return {};
}

}  // namespace relievo::v4l2
