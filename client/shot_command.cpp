// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/size_option.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/latest_frame.h"
#include "client/options.h"
#include "client/range_frames.h"
#include "client/recorded_stream.h"
#include "client/shot/output.h"
#include "client/shot/render.h"
#include "client/time_range.h"
#include "idl/cdr.h"

namespace relievo {
namespace {

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::shared_ptr<RangeOptions> range;
  std::string input, stream, out;
  std::string mode = "textured", view = "orbit", background = "white";
  Orbit orbit;
  Size size{1280, 720};
  double wait_s = 10;
  double seconds = 10;
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

  Image8 take(const Frame3D& frame, const std::optional<PinholeModel>& rig) {
    const auto& [width, height] = options_.size;
    if (!view_) render_.depth = depth_range_of(frame.surface);
    if (options_.view == "rig" && rig) {
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

/// Returns how many frames could not be decoded.
Result<std::uint64_t> draw_recording(const Options& options, Camera& camera, ShotOutput& output,
                                     StopSignal& stop) {
  auto recorded = RecordedStream::open(options.input, options.stream);
  if (!recorded) return recorded.error();
  if (const Status free = recorded->check_output(options.out); !free) return free.error();
  recorded->warn_if_cut();
  const auto range = find_range(*options.range, *recorded);
  if (!range) return range.error().in(options.input);
  const auto infos = recorded->read_infos();
  if (!infos) return infos.error();
  if (options.view == "rig" && infos->empty())
    return Error{options.input + " says nothing of the rig's camera: use --view orbit"};
  auto frames = RangeFrames::open(*recorded, *range);
  if (!frames) return frames.error();

  Progress progress("shot", "frames", options.out.ends_with(".png") ? 1 : range->frames);
  while (!stop.stopped() && !output.full()) {
    const auto next = frames->next();
    if (!next) return next.error();
    if (!*next) break;
    const RecordedInfo* const info = info_of((*next)->sample, *infos);
    const auto rig = info != nullptr ? std::optional(info->info.rig.camera) : std::nullopt;
    if (auto status = output.add((*next)->frame, camera.take((*next)->frame, rig)); !status)
      return status.error();
    progress.update(output.count());
  }
  if (output.count() == 0 && !stop.stopped())
    return Error{options.input + ": no frame in that range can be decoded"};
  const LeftOut& left_out = frames->left_out();
  if (left_out.frames() > 0) log_warning(left_out.text());
  return left_out.frames();
}

Status draw_live(const Options& options, Camera& camera, ShotOutput& output, StopSignal& stop) {
  LatestFrame latest;
  auto subscriber = Subscriber::create(*options.domain, options.input, latest.callbacks());
  if (!subscriber) return subscriber.error();
  Progress progress("shot", "frames");
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();
  while (!stop.stopped() && !output.full()) {
    const auto taken = latest.take(std::chrono::duration<double>(options.wait_s), stop);
    if (!taken || taken->frame.time_ns > end_ns) break;
    if (output.count() == 0)
      end_ns = taken->frame.time_ns + std::llround(options.seconds * kNanosecondsPerSecond);
    if (auto status = output.add(taken->frame, camera.take(taken->frame, taken->camera)); !status)
      return status;
    progress.update(output.count());
  }
  if (output.count() == 0 && !stop.stopped())
    return Error{"no frame of a stream '" + options.input + "' came in " + duration_text(options.wait_s) +
                 ": is its server running? `relievo streams` lists what there is"};
  return {};
}

Status run(const Options& options, StopSignal& stop) {
  const auto file = is_file(options.input);
  if (!file) return file.error();
  const auto made = ShotOutput::create(options.out);
  if (!made) return made.error();
  ShotOutput& output = **made;
  if (!output.has_transparency() && options.background == "transparent")
    return Error{"a video has no transparency: give another --background, or a folder of pictures"};
  Camera camera(options);
  std::uint64_t left_out = 0;
  if (*file) {
    const auto drawn = draw_recording(options, camera, output, stop);
    if (!drawn) return drawn.error();
    left_out = *drawn;
  } else if (auto drawn = draw_live(options, camera, output, stop); !drawn) {
    return drawn;
  }
  if (output.count() > 0) {
    if (const Status finished = output.finish(); !finished) return finished;
  }
  const std::string written = std::to_string(output.count()) + " pictures are in " + options.out;
  if (stop.stopped() && !output.full()) return Error{"stopped early: " + written};
  if (options.json) {
    nlohmann::json j{{"pictures", output.count()},
                     {"out", options.out},
                     {"last", output.last()},
                     {"unreadable", left_out}};
    if (options.mode == "depth") j["depth_m"] = {camera.depth().from_m, camera.depth().to_m};
    std::puts(json_text(j).c_str());
  } else {
    std::puts(output.count() == 1 ? output.last().c_str() : written.c_str());
  }
  if (options.mode == "depth" && !options.json)
    log_info("depth from " + std::to_string(camera.depth().from_m) + " m (yellow) to " +
             std::to_string(camera.depth().to_m) + " m (violet)");
  return {};
}

}  // namespace

Command shot_command() {
  return {
      "shot", "Draw a stream or a recording into pictures, without a screen", [](CLI::App& app) {
        auto o = std::make_shared<Options>();
        o->domain = add_domain_options(app);
        app.add_option("input", o->input, "Recording, or live stream")->type_name("FILE|STREAM")->required();
        app.add_option(
               "--out", o->out,
               "NAME.png: one frame; NAME.mp4 or .mkv: a video; anything else: a folder, a picture a frame")
            ->type_name("NAME.png|NAME.mp4|DIR")
            ->required();
        app.add_option("--stream", o->stream, "Which stream, where the file holds several")
            ->type_name("NAME");
        o->range = add_range_options(app);
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
        app.add_option("--seconds", o->seconds, "Of a live stream, where not one picture is asked for")
            ->check(number(0.001, 1e9))
            ->capture_default_str();
        app.add_option("--wait", o->wait_s, "Seconds to wait for a live stream")
            ->check(number(0, 1e9))
            ->capture_default_str();
        app.add_flag("--json", o->json, "Print the result as JSON");
        app.final_callback([o, &app] {
          check_given(app, o->input,
                      {.of_files = {"--stream", "--from", "--to", "--frames"}, .of_streams = {"--seconds"}});
        });
        app.footer(
            "Examples:\n  relievo shot face --out face.png\n"
            "  relievo shot face.mcap --from 3 --mode shaded --azimuth -30 --out face.png\n"
            "  relievo shot face.mcap --view rig --background transparent --out frames\n"
            "  relievo shot face --seconds 5 --out face.mp4");
        return [o](StopSignal& stop) { return run(*o, stop); };
      }};
}

}  // namespace relievo
