// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "cli/checks.h"
#include "cli/size_option.h"
#include "client/commands.h"
#include "client/frame_input.h"
#include "client/shot/output.h"
#include "client/shot/render.h"
#include "codec/video_file.h"

namespace relievo {
namespace {

struct Options {
  std::shared_ptr<FrameInput> input;
  std::string out;
  std::string mode = "textured", view = "orbit", background = "white";
  Orbit orbit;
  Size size{1280, 720};
  bool json = false;
};

const std::map<std::string, Rgba> kBackgrounds{{"white", {255, 255, 255, 255}},
                                               {"grey", {128, 128, 128, 255}},
                                               {"black", {0, 0, 0, 255}},
                                               {"transparent", {0, 0, 0, 0}}};

std::optional<Rgba> parse_background(const std::string& text) {
  if (const auto named = kBackgrounds.find(text); named != kBackgrounds.end()) return named->second;
  std::uint32_t rgb = 0;
  if (text.size() != 7 || text[0] != '#') return std::nullopt;
  const auto [end, failed] = std::from_chars(text.data() + 1, text.data() + 7, rgb, 16);
  if (failed != std::errc{} || end != text.data() + 7) return std::nullopt;
  return Rgba{static_cast<std::uint8_t>(rgb >> 16), static_cast<std::uint8_t>(rgb >> 8 & 255),
              static_cast<std::uint8_t>(rgb & 255), 255};
}

/// Draws the frames of one stream alike: colours, and the eye that is not the rig's, are chosen by the first.
class Camera {
 public:
  explicit Camera(const Options& options) : options_(options) {
    render_.mode = shot_mode_named(options.mode).value_or(ShotMode::kTextured);  // the option is checked
    render_.background = parse_background(options.background).value_or(Rgba{});
  }

  Image8 take(const Frame3D& frame, const PinholeModel* rig) {
    const auto& [width, height] = options_.size;
    if (!view_) render_.depth = depth_range_of(frame.surface);
    if (options_.view == "rig" && rig != nullptr) {
      view_ = rig_view(*rig, width, height);  // which another session may have changed
    } else if (!view_) {
      view_ = orbit_view(extent_of(frame.surface.positions), options_.orbit, width, height);
    }
    return render(frame, *view_, render_);
  }

  const DepthRange& depth() const { return render_.depth; }

 private:
  const Options& options_;
  RenderOptions render_;
  std::optional<ShotView> view_;
};

Status run(const Options& options, StopSignal& stop) {
  const auto made = ShotOutput::create(options.out);
  if (!made) return made.error();
  ShotOutput& output = **made;
  if (!output.has_transparency() && options.background == "transparent")
    return Error{"a video has no transparency: give another --background, or a folder of pictures"};
  Camera camera(options);
  FrameVisit visit{.verb = "shot", .out = options.out};
  if (options.out.ends_with(".png")) visit.most = 1;
  visit.frame = [&](const Frame3D& frame, const PinholeModel* rig) -> Status {
    if (options.view == "rig" && rig == nullptr)
      return Error{options.input->input + " says nothing of the rig's camera: use --view orbit"};
    return output.add(frame, camera.take(frame, rig));
  };
  const auto left_out = visit_frames(*options.input, visit, stop);
  if (!left_out) return left_out.error();
  if (output.count() > 0) {
    if (const Status finished = output.finish(); !finished) return finished;
  }
  const std::string written =
      counted(output.count(), "picture") + " " + is_or_are(output.count()) + " in " + options.out;
  if (stop.stopped() && !output.full()) return Error{"stopped early: " + written};
  if (options.json) {
    nlohmann::json j{{"pictures", output.count()},
                     {"out", options.out},
                     {"last", output.last()},
                     {"unreadable", left_out->frames()}};
    if (options.mode == "depth") j["depth_m"] = {camera.depth().from_m, camera.depth().to_m};
    std::puts(json_text(j).c_str());
  } else if (left_out->unreadable == 0) {
    std::puts(output.count() == 1 ? output.last().c_str() : written.c_str());
  }
  if (options.mode == "depth" && !options.json)
    log_info("depth from " + std::to_string(camera.depth().from_m) + " m (yellow) to " +
             std::to_string(camera.depth().to_m) + " m (violet)");
  return left_out->told(written);
}

}  // namespace

Command shot_command() {
  return {
      "shot", "Draw a stream or a recording into pictures, without a screen", [](CLI::App& app) {
        auto o = std::make_shared<Options>();
        o->input = add_frame_input(app);
        o->input->seconds = 10;
        app.add_option(
               "--out", o->out,
               "NAME.png: one frame; NAME.mp4 or .mkv: a video; anything else: a folder, a picture a frame")
            ->check([](const std::string& out) {
              return out.ends_with(".png") || is_video_name(out) ? std::string() : folder_name()(out);
            })
            ->type_name("NAME.png|NAME.mp4|DIR")
            ->required();
        app.add_option("--mode", o->mode, std::string(shot_mode_names()))
            ->check([](const std::string& name) {
              return shot_mode_named(name) ? std::string() : "give " + std::string(shot_mode_names());
            })
            ->type_name("NAME")
            ->capture_default_str();
        app.add_option("--view", o->view, "orbit, or rig: what the rig's camera sees")
            ->check(CLI::IsMember({"orbit", "rig"}))
            ->type_name("NAME")
            ->capture_default_str();
        app.add_option("--azimuth", o->orbit.azimuth_deg,
                       "The eye's, degrees to the right of the rig's camera")
            ->check(number(-180, 180))
            ->capture_default_str();
        app.add_option("--elevation", o->orbit.elevation_deg, "Degrees above it")
            ->check(number(-89, 89))
            ->capture_default_str();
        app.add_option("--zoom", o->orbit.zoom, "2: twice as large")
            ->check(number(0.05, 100))
            ->capture_default_str();
        app.add_option("--fov", o->orbit.fov_deg, "Upright, degrees")
            ->check(number(5, 120))
            ->capture_default_str();
        add_size_option(app, "--size", o->size, "Of the picture, pixels (default 1280x720)");
        app.add_option("--background", o->background, "white, grey, black, transparent or #RRGGBB")
            ->check([](const std::string& text) {
              return parse_background(text) ? "" : "give white, grey, black, transparent or #RRGGBB";
            })
            ->type_name("COLOUR")
            ->capture_default_str();
        app.add_option("--seconds", o->input->seconds, "Of a live stream, where not one picture is asked for")
            ->check(number(0.001, 1e9))
            ->capture_default_str();
        app.add_flag("--json", o->json, "Print the result as JSON");
        app.footer(
            "Examples:\n  relievo shot face --out face.png\n"
            "  relievo shot face.mcap --from 3 --mode shaded --azimuth -30 --out face.png\n"
            "  relievo shot face.mcap --view rig --background transparent --out frames\n"
            "  relievo shot face --seconds 5 --out face.mp4");
        return [o](StopSignal& stop) { return run(*o, stop); };
      }};
}

}  // namespace relievo
