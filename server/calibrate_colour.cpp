// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/log.h"
#include "base/whole_file.h"
#include "capture/calibrate/colour.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/rig_part.h"
#include "capture/camera_response.h"
#include "capture/field_order_file.h"
#include "capture/picture_file.h"
#include "cli/checks.h"
#include "server/calibrate_commands.h"
#include "server/calibrate_live.h"
#include "server/calibrate_views.h"
#include "server/calibration_report.h"
#include "server/camera_flags.h"

namespace relievo {
namespace {

constexpr const char* kChannels[] = {"red", "green", "blue"};

struct Options {
  std::string captures;
  std::string source;
  CameraOptions camera;
  ProjectorFlags projector;
  std::string out;
  std::string update;
  std::vector<int> roi;
  std::optional<double> gamma;
  bool json = false;
};

/// "100.png", or "100_anything.png" where a colour was captured several times.
std::optional<Primary> colour_of(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  if (stem.size() > 3 && stem[3] != '_' && stem[3] != '-') return std::nullopt;
  return primary_of(stem.substr(0, 3));
}

Result<std::vector<ColourCapture>> read_captures(const std::string& folder) {
  auto files = pictures_in(folder);
  if (!files) return files.error();
  std::vector<ColourCapture> out;
  for (const auto& file : *files) {
    const auto colour = colour_of(file);
    if (!colour) {
      log_warning(file.string() + " is not used: its name says no colour such as 100 (red)");
      continue;
    }
    auto picture = read_rgb(file);
    if (!picture) return picture.error();
    out.push_back({file.filename().string(), *colour, std::move(*picture)});
  }
  if (out.empty()) {
    return Error{
        folder +
        " has no captures: name each picture by the projected colour, 100.png (red), 010.png, 001.png, "
        "011.png, 101.png, 110.png, 000.png (black), 111.png (white)"};
  }
  return out;
}

bool is_palette(Primary colour) {
  return colour != 0 && colour != 7;
}

void print_json(const ColourCalibration& c, const std::string& out) {
  auto json = nlohmann::json::parse(colour_report(c));
  json["rig"] = out;
  std::puts(json_text(json).c_str());
}

void print(const ColourCalibration& c, const std::string& out) {
  std::printf("target     %zu pixels in %d,%d,%d,%d; noise %.2f of 255\n", c.target_pixels, c.target.x,
              c.target.y, c.target.width, c.target.height, c.noise);
  std::printf("colour     captured          estimated         residual  margin over %.0f\n",
              kDetectionThreshold);
  for (const ColourReport& r : c.colours) {
    std::printf("%s        %4.0f %4.0f %4.0f    %4.0f %4.0f %4.0f    %6.1f", primary_name(r.colour).c_str(),
                r.captured[0], r.captured[1], r.captured[2], r.estimated[0], r.estimated[1], r.estimated[2],
                r.residual);
    if (is_palette(r.colour)) {
      std::printf("    %+6.1f in %s, %.0f sigmas of noise", r.weakest_difference - kDetectionThreshold,
                  kChannels[r.weakest_channel], r.weakest_in_sigmas);
    }
    std::printf("\n");
  }
  const auto& m = c.camera.matrix;
  for (int row = 0; row < 3; ++row) {
    const auto at = static_cast<std::size_t>(3 * row);
    std::printf("%s  %8.4f %8.4f %8.4f\n", row == 0 ? "matrix   " : "         ", m[at], m[at + 1], m[at + 2]);
  }
  if (c.camera.gamma != 1) std::printf("gamma      %.2f, taken out of what is decoded\n", c.camera.gamma);
  std::printf("residual   %.2f of 255 (RMS)\nwritten    %s\n", c.residual, out.c_str());
}

/// Where the camera answers to each of the projector's primaries with another channel, as pictures written
/// BGR do.
void warn_of_exchanged_channels(const ColourCalibration& c) {
  std::set<std::size_t> answered;
  std::string other;
  for (const ColourReport& r : c.colours) {
    for (std::size_t own = 0; own < 3; ++own) {
      if (r.colour != Primary{1} << own) continue;
      const auto channel =
          static_cast<std::size_t>(std::ranges::max_element(r.captured) - r.captured.begin());
      answered.insert(channel);
      if (channel != own)
        other += (other.empty() ? "" : ", ") + std::string(kChannels[own]) + " as " + kChannels[channel];
    }
  }
  if (answered.size() == 3 && !other.empty())
    log_warning("the camera sees " + other +
                ": were the channels of its pictures exchanged, as BGR? They are decoded all the same, but "
                "textures have these colours");
}

void warn(const ColourCalibration& c) {
  warn_of_exchanged_channels(c);
  if (c.residual > kMostResidual) {
    char residual[16];
    std::snprintf(residual, sizeof residual, "%.0f", c.residual);
    log_warning(std::string("the colours are far off, by ") + residual +
                " of 255 (RMS), where a few are usual: is each picture named by its colour, is there other "
                "light, or does "
                "the camera change its exposure by itself?");
  }
  for (const ColourReport& r : c.colours) {
    if (!is_palette(r.colour) || r.weakest_difference > kDetectionThreshold) continue;
    log_warning(
        "colour " + primary_name(r.colour) + " will hardly be detected: its " + kChannels[r.weakest_channel] +
        " channel differs too little from the complement's; check that capture and the projector's colours");
  }
}

Status run(const Options& options, StopSignal& stop) {
  RigPart before;
  if (!options.update.empty()) {
    auto part = rig_to_update(options.update);
    if (!part) return part.error();
    before = *part;
  }
  if (!options.source.empty()) {
    const Status taken = take_colour_captures({.source = options.source,
                                               .camera = options.camera,
                                               .folder = options.captures,
                                               .projector = options.projector.choice()},
                                              stop);
    if (!taken) return taken.error();
    if (stop.stopped()) return {};
  }
  auto captures = read_captures(options.captures);
  if (!captures) return captures.error();
  ColourOptions how;
  if (!options.roi.empty()) how.roi = Roi{options.roi[0], options.roi[1], options.roi[2], options.roi[3]};
  how.camera_gamma = options.gamma;
  const auto calibration = calibrate_colour(*captures, how);
  if (!calibration) return calibration.error().in(options.captures);

  const std::string out = options.out.empty() ? options.update : options.out;
  before.colours = calibration->camera;
  const std::string yaml = keeping_field_order(to_yaml(before), options.update);
  if (const Status written = write_whole_file(out, yaml); !written) return written;
  if (options.json) {
    print_json(*calibration, out);
  } else {
    print(*calibration, out);
  }
  warn(*calibration);
  return {};
}

}  // namespace

std::function<Status(StopSignal&)> define_calibrate_colour(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option(
         "captures", o->captures,
         "Folder of captures of a white target, named by the projected colour: 100.png is red, 000.png black")
      ->required();
  auto* out = app.add_option("-o,--out", o->out,
                             "The rig.yaml to write: with colours only, unless --update gives the rest");
  auto* update =
      app.add_option("--update", o->update,
                     "A rig.yaml: keep all but its colour matrix; written back unless --out says otherwise");
  auto* source = app.add_option(
      "--source", o->source,
      "Take the captures from a live source first, into the folder: a white sheet at rest under black, "
      "red, green and blue, each with its complement");
  add_live_projector_options(app, *source, o->projector);
  app.add_option("--gamma", o->gamma,
                 "The camera's, 1: its values are light (default: that with which the captures add up)")
      ->check(number(1, CameraResponse::kMostGamma));
  app.add_option("--roi", o->roi, "The target, where it should not be looked for: X,Y,WIDTH,HEIGHT")
      ->delimiter(',')
      ->expected(4);
  add_camera_flags(app, o->camera);
  app.add_flag("--json", o->json, "Print the report as JSON");
  app.final_callback([out, update] {
    if (out->empty() && update->empty()) throw CLI::RequiredError("--out or --update");
  });
  return [o](StopSignal& stop) { return run(*o, stop); };
}

}  // namespace relievo
