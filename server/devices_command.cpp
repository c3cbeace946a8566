// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_text.h"
#include "base/log.h"
#include "capture/source/v4l2/describe.h"
#include "server/commands.h"

namespace relievo {
namespace {

using namespace v4l2;

struct Options {
  std::vector<std::string> devices;
  bool json = false;
};

nlohmann::json to_json(const FormatDescription& format) {
  nlohmann::json sizes = nlohmann::json::array();
  for (const SizeRange& s : format.sizes) {
    nlohmann::json size = {{"width", s.most_width}, {"height", s.most_height}, {"rates", s.rates}};
    if (s.width_step > 0) {
      size["least_width"] = s.least_width;
      size["least_height"] = s.least_height;
      size["width_step"] = s.width_step;
      size["height_step"] = s.height_step;
    }
    sizes.push_back(size);
  }
  return {{"name", format.name}, {"label", format.label}, {"readable", format.readable}, {"sizes", sizes}};
}

nlohmann::json to_json(const Control& control) {
  nlohmann::json json = {{"name", control.name},
                         {"label", control.label},
                         {"kind", control.kind},
                         {"read_only", control.read_only},
                         {"inactive", control.inactive}};
  if (control.kind == "text") {
    json["value"] = control.text;
  } else if (control.kind != "button") {
    json["value"] = control.value;
    json["default"] = control.usual;
    json["least"] = control.least;
    json["most"] = control.most;
    json["step"] = control.step;
  }
  if (control.kind == "menu") {
    json["menu"] = nlohmann::json::array();
    for (const MenuItem& item : control.menu)
      json["menu"].push_back({{"value", item.value}, {"name", item.name}});
  }
  return json;
}

nlohmann::json to_json(const DeviceDescription& d) {
  nlohmann::json inputs = nlohmann::json::array(), formats = nlohmann::json::array(),
                 controls = nlohmann::json::array();
  for (const Input& input : d.inputs) {
    inputs.push_back({{"number", input.number},
                      {"name", input.name},
                      {"trouble", input.trouble},
                      {"standards", standard_names(input.standards)}});
  }
  for (const FormatDescription& format : d.formats) formats.push_back(to_json(format));
  for (const Control& control : d.controls) controls.push_back(to_json(control));
  return {{"device", d.path},
          {"label", d.label},
          {"driver", d.driver},
          {"bus", d.bus},
          {"now", d.now},
          {"multiplanar", d.multiplanar},
          {"inputs", inputs},
          {"current_input", d.current_input},
          {"current_standards", d.current_standards},
          {"formats", formats},
          {"controls", controls}};
}

std::string joined(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += " " + word;
  return all;
}

void print(const FormatDescription& format) {
  std::printf("  format   %-8s %s%s\n", format.name.c_str(), format.label.c_str(),
              format.readable ? "" : " (cannot be read here)");
  for (const SizeRange& s : format.sizes) {
    if (s.width_step > 0) {
      std::printf("           %dx%d to %dx%d", s.least_width, s.least_height, s.most_width, s.most_height);
    } else {
      std::printf("           %dx%d", s.most_width, s.most_height);
    }
    for (std::size_t i = 0; i < s.rates.size(); ++i) std::printf("%s %.4g", i == 0 ? " at" : ",", s.rates[i]);
    std::printf("%s\n", s.rates.empty() ? "" : " Hz");
  }
}

void print(const Control& c) {
  std::printf("  control  %-32s", c.name.c_str());
  if (c.kind == "text") {
    std::printf(" \"%s\"", c.text.c_str());
  } else if (c.kind == "button") {
    std::printf(" a button");
  } else if (c.kind == "boolean") {
    std::printf(" %lld, 0 or 1 (usual %lld)", static_cast<long long>(c.value),
                static_cast<long long>(c.usual));
  } else {
    std::printf(" %lld, %lld to %lld (usual %lld)", static_cast<long long>(c.value),
                static_cast<long long>(c.least), static_cast<long long>(c.most),
                static_cast<long long>(c.usual));
  }
  std::printf("%s%s\n", c.read_only ? ", read only" : "", c.inactive ? ", inactive" : "");
  for (const MenuItem& item : c.menu)
    std::printf("           %lld: %s\n", static_cast<long long>(item.value), item.name.c_str());
}

void print(const DeviceDescription& d) {
  std::printf("%s  %s (%s, %s)\n", d.path.c_str(), d.label.c_str(), d.driver.c_str(), d.bus.c_str());
  std::printf("  now      %s%s\n", d.now.empty() ? "no format yet" : d.now.c_str(),
              joined(d.current_standards).c_str());
  for (const Input& input : d.inputs) {
    std::printf("  input    %u: %s%s%s%s\n", input.number, input.name.c_str(),
                static_cast<int>(input.number) == d.current_input ? ", selected" : "",
                input.trouble.empty() ? "" : ", ", input.trouble.c_str());
    if (input.standards != 0)
      std::printf("           standards%s\n", joined(standard_names(input.standards)).c_str());
  }
  for (const FormatDescription& format : d.formats) print(format);
  for (const Control& control : d.controls) print(control);
}

Status run(const Options& options) {
  const bool named = !options.devices.empty();
  std::vector<DeviceDescription> found;
  for (const std::string& path : named ? options.devices : device_paths()) {
    auto device = describe(kernel_io(), path);
    if (!device && named) return device.error();
    if (!device) {
      log_debug(device.error().message);  // a metadata node beside a camera, or one not permitted
      continue;
    }
    found.push_back(*std::move(device));
  }
  if (options.json) {
    nlohmann::json devices = nlohmann::json::array();
    for (const DeviceDescription& device : found) devices.push_back(to_json(device));
    std::puts(json_text(nlohmann::json({{"devices", devices}})).c_str());
  } else {
    for (const DeviceDescription& device : found) print(device);
    if (found.empty()) log_info("no camera found; -v says what was looked at");
  }
  return {};
}

}  // namespace

Command devices_command() {
  return {"devices", "List cameras: formats, sizes, rates, inputs, standards, controls", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("device", options->devices, "Devices such as /dev/video0 (default: all)");
            app.add_flag("--json", options->json, "Print the list as JSON");
            return [options](StopSignal&) { return run(*options); };
          }};
}

}  // namespace relievo
