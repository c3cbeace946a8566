// SPDX-License-Identifier: Apache-2.0
#include "server/camera_flags.h"

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "cli/checks.h"
#include "cli/size_option.h"

namespace relievo {
namespace {

constexpr const char* kGroup = "Camera (--source v4l2:DEVICE; relievo-server devices lists what there is)";

void add_control(const std::vector<std::string>& given, CameraOptions& camera) {
  for (const std::string& text : given) {
    const std::size_t equals = text.find('=');
    camera.controls.push_back({text.substr(0, equals), text.substr(equals + 1)});
  }
}

}  // namespace

void add_camera_flags(CLI::App& app, CameraOptions& camera) {
  app.add_option("--input", camera.input, "The device's input, by number or name")
      ->type_name("INPUT")
      ->group(kGroup);
  app.add_option("--standard", camera.standard, "TV standard, such as NTSC-M or PAL-B; auto detects it")
      ->type_name("NAME")
      ->group(kGroup);
  app.add_option("--format", camera.format, "Pixel format (default: the device's best)")
      ->type_name("NAME")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--size",
         [&camera](const std::string& text) {
           const Size size = parse_size(text).value_or(Size{});
           camera.width = size.width;
           camera.height = size.height;
         },
         "Size of a whole frame (default: the rig's, else as the device is set)")
      ->type_name("WxH")
      ->check([](const std::string& text) {
        return parse_size(text) ? std::string() : text + " is no size such as 640x480";
      })
      ->group(kGroup);
  app.add_option("--rate", camera.rate, "Pictures a second; of interlaced video, frames")
      ->check(number(kLeastRate, kMostRate))
      ->group(kGroup);
  app.add_option("--field", camera.field, "How the fields lie in the device's buffers")
      ->check(CLI::IsMember(kFieldLayouts))
      ->type_name("NAME")
      ->group(kGroup);
  app.add_option("--field-order", camera.field_order,
                 "The field exposed first (default: as the rig says, or else the device)")
      ->check(CLI::IsMember(kFieldOrders))
      ->type_name("NAME")
      ->group(kGroup);
  app.add_flag("--odd-pairs", camera.odd_pairs,
               "Progressive: the pictures 1, 3, ... are under slides, not 0, 2, ...")
      ->group(kGroup);
  app.add_option_function<std::vector<std::string>>(
         "--control", [&camera](const std::vector<std::string>& given) { add_control(given, camera); },
         "Set a control, such as exposure_time_absolute=100; repeatable, in this order")
      ->type_name("NAME=VALUE")
      ->check([](const std::string& text) {
        const std::size_t equals = text.find('=');
        return equals != std::string::npos && equals > 0 ? std::string() : "'" + text + "' is no NAME=VALUE";
      })
      ->expected(1)
      ->take_all()
      ->group(kGroup);
  app.add_flag("--dmabuf", camera.dmabuf,
               "Read through exported DMA-BUFs instead of the device's own mapping")
      ->group(kGroup);
  app.add_option("--buffers", camera.buffers, "Buffers that the device fills in turn (default 6)")
      ->check(CLI::Range(kLeastBuffers, kMostBuffers))
      ->group(kGroup);
}

void add_rig_flags(CLI::App& app, CameraOptions& camera) {
  app.add_option("--rig", camera.rig, "The calibrated rig.yaml")->type_name("FILE")->group(kGroup);
  app.add_option("--pattern", camera.pattern,
                 "What is projected: a pattern.yaml (default: the one beside the rig)")
      ->type_name("FILE")
      ->group(kGroup);
}

Status check_rig(const std::string& source, const CameraOptions& camera) {
  if (!source.starts_with("v4l2:") || !camera.rig.empty()) return {};
  return Error{"a camera needs its calibrated rig: give --rig FILE, which relievo-server calibrate writes"};
}

CameraOptions merged(CameraOptions base, const CameraOptions& flags) {
  const CameraOptions unset;
  const auto set = [&](auto CameraOptions::*field) {
    if (flags.*field != unset.*field) base.*field = flags.*field;
  };
  set(&CameraOptions::rig);
  set(&CameraOptions::pattern);
  set(&CameraOptions::input);
  set(&CameraOptions::standard);
  set(&CameraOptions::format);
  set(&CameraOptions::width);
  set(&CameraOptions::height);
  set(&CameraOptions::rate);
  set(&CameraOptions::field);
  set(&CameraOptions::field_order);
  set(&CameraOptions::odd_pairs);
  set(&CameraOptions::dmabuf);
  set(&CameraOptions::buffers);
  base.controls.insert(base.controls.end(), flags.controls.begin(), flags.controls.end());
  return base;
}

}  // namespace relievo
