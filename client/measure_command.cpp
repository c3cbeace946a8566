// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "cli/checks.h"
#include "client/commands.h"
#include "client/frame_input.h"
#include "client/measure/shape_meter.h"
#include "codec/export.h"

namespace relievo {
namespace {

constexpr double kMostOff = 0.2;  // of the points: then it is doubtful that they show that shape
constexpr double kLeastFull_m = 1e-6;

struct Options {
  std::shared_ptr<FrameInput> input;
  std::string picture, region;
  std::string shape = "plane";
  bool json = false;
};

/// "COLUMN,ROW,WIDTH,HEIGHT", all above 0 but the first two.
std::optional<PictureRegion> parse_region(const std::string& text) {
  PictureRegion r;
  int end = 0;
  if (std::sscanf(text.c_str(), "%5d,%5d,%5d,%5d%n", &r.column, &r.row, &r.width, &r.height, &end) != 4 ||
      static_cast<std::size_t>(end) != text.size() || r.column < 0 || r.row < 0 || r.width < 1 ||
      r.height < 1)
    return std::nullopt;
  return r;
}

/// What frames are given to, made with the first.
class Meter {
 public:
  explicit Meter(const Options& options) : options_(options) {}

  Status add(const Frame3D& frame, const PinholeModel& camera) {
    if (!meter_) {
      region_ = options_.region.empty() ? middle_region(camera)
                                        : parse_region(options_.region).value_or(PictureRegion{});
      if (region_.column + region_.width > camera.width || region_.row + region_.height > camera.height)
        return Error{"--region " + options_.region + " is not within the camera's picture of " +
                     std::to_string(camera.width) + "x" + std::to_string(camera.height)};
      camera_ = camera;
      meter_.emplace(camera, region_, shape_kind_named(options_.shape).value_or(ShapeKind::kPlane));
    } else if (camera.width != camera_.width || camera.height != camera_.height ||
               camera.matrix != camera_.matrix || camera.distortion != camera_.distortion) {
      return Error{"the camera is another one from some frame on: measure the parts by themselves"};
    }
    return meter_->add(frame);
  }

  bool empty() const { return !meter_; }
  const ShapeMeter& meter() const { return *meter_; }
  const PictureRegion& region() const { return region_; }

 private:
  const Options& options_;
  PinholeModel camera_;
  PictureRegion region_;
  std::optional<ShapeMeter> meter_;
};

nlohmann::json json_of(const Spread& spread, double unit) {
  return {{"median", spread.median * unit}, {"sd", spread.deviation * unit}};
}

void print_json(const Options& options, const PictureRegion& region, const ShapeReport& report) {
  using nlohmann::json;
  json j{{"shape", options.shape},
         {"region", {region.column, region.row, region.width, region.height}},
         {"frames", report.frames},
         {"frames_without", report.without_shape},
         {"points", json_of(report.points, 1)},
         {"off", json_of(report.off, 1)},
         {"filled", report.filled},
         {"rms_mm", json_of(report.rms_m, 1e3)},
         {"expected_mm", report.expected_m ? json_of(*report.expected_m, 1e3) : json()},
         {"span_mm", json_of(report.span_m, 1e3)},
         {"form_mm", report.form_m * 1e3},
         {"noise_mm", report.noise_m ? json(*report.noise_m * 1e3) : json()}};
  if (options.shape == "plane") {
    j["depth_mm"] = json_of(report.size_m, 1e3);
    j["tilt_deg"] = json_of(report.tilt_deg, 1);
  } else {
    j["radius_mm"] = json_of(report.size_m, 1e3);
    j["centre_mm"] = json::array();
    for (const Spread& c : report.centre_m) j["centre_mm"].push_back(json_of(c, 1e3));
  }
  std::puts(json_text(j).c_str());
}

void print_text(const Options& options, const ShapeReport& r) {
  if (options.shape == "plane")
    std::printf(
        "plane   %.3f mm away at the region's middle (%.3f from frame to frame), tilted by %.2f degrees\n",
        r.size_m.median * 1e3, r.size_m.deviation * 1e3, r.tilt_deg.median);
  else
    std::printf("sphere  radius %.3f mm (%.3f from frame to frame), centre %.2f %.2f %.2f mm\n",
                r.size_m.median * 1e3, r.size_m.deviation * 1e3, r.centre_m[0].median * 1e3,
                r.centre_m[1].median * 1e3, r.centre_m[2].median * 1e3);
  std::printf("points  %.0f a frame, %s; %.2f %% of the region has surface\n", r.points.median,
              counted(r.frames, "frame").c_str(), 100 * r.filled);
  std::printf("error   RMS %.4f mm", r.rms_m.median * 1e3);
  if (r.expected_m) std::printf(" (%.4f by the points' own standard deviations)", r.expected_m->median * 1e3);
  std::printf(", 99.7 %% within %.4f mm, %.2f %% off it\n", r.span_m.median * 1e3, 100 * r.off.median);
  std::printf("form    RMS %.4f mm, which averaging frames leaves\n", r.form_m * 1e3);
  if (r.noise_m) std::printf("noise   %.4f mm from frame to frame, a pixel's depth\n", *r.noise_m * 1e3);
}

Status run(const Options& options, StopSignal& stop) {
  Meter meter(options);
  const auto measured = visit_frames(
      *options.input,
      {.verb = "measure",
       .out = options.picture,
       .frame = [&](const Frame3D& frame, const PinholeModel* camera) -> Status {
         if (camera == nullptr)
           return Error{options.input->input + " says nothing of the rig's camera, which this needs"};
         return meter.add(frame, *camera);
       }},
      stop);
  if (!measured) return measured.error();
  if (measured->frames() > 0) log_warning(measured->text());
  if (meter.empty()) return Error{"stopped before a frame was measured"};
  const ShapeReport report = meter.meter().report();
  if (report.frames == 0)
    return Error{
        "there is no " + options.shape +
        " in the region: fewer than 50 points lie in it, or on no one shape. Give another --region; `relievo "
        "shot --view rig` shows the camera's picture"};
  if (report.without_shape > 0)
    log_warning(counted(report.without_shape, "frame") + " had no " + options.shape + " in the region");
  if (report.off.median > kMostOff)
    log_warning("much of what is in the region is no part of one " + options.shape + ": is --region on it?");
  if (!options.picture.empty()) {
    const double full_m = std::max(3 * report.form_m, kLeastFull_m);
    if (Status written = write_png(options.picture, meter.meter().picture(full_m).view()); !written)
      return written;
    char scale[32];
    std::snprintf(scale, sizeof scale, "%.3g mm", full_m * 1e3);
    log_info(options.picture + ": red is " + scale + " before the " + options.shape + ", blue behind it");
  }
  if (options.json) {
    print_json(options, meter.region(), report);
  } else {
    print_text(options, report);
  }
  return {};
}

}  // namespace

Command measure_command() {
  return {
      "measure", "How exactly a flat wall or a ball is seen: error, form, noise, holes", [](CLI::App& app) {
        auto o = std::make_shared<Options>();
        o->input = add_frame_input(app);
        o->input->seconds = 2;
        app.add_option("--shape", o->shape, "plane or sphere: what is there")
            ->check(one_of({"plane", "sphere"}))
            ->type_name("NAME")
            ->capture_default_str();
        app.add_option(
               "--region", o->region,
               "Where it is in the rig camera's picture, pixels (default: the middle, .4 of it each way)")
            ->check([](const std::string& text) {
              return parse_region(text) ? "" : "give COLUMN,ROW,WIDTH,HEIGHT, as 100,80,200,150";
            })
            ->type_name("COLUMN,ROW,WIDTH,HEIGHT");
        app.add_option("--picture", o->picture,
                       "Draw how far what is seen lies before (red) or behind (blue)")
            ->check(png_name())
            ->type_name("NAME.png");
        app.add_option("--seconds", o->input->seconds, "Of a live stream")
            ->check(number(0, 1e9))
            ->capture_default_str();
        app.add_flag("--json", o->json, "Print the result as JSON");
        app.footer(
            "The shape is fitted to each frame's measured points; figures are medians of the frames. What is "
            "more\n"
            "than five robust deviations off the shape is counted as off, and in nothing else.\n\n"
            "Examples:\n  relievo measure wall.mcap\n"
            "  relievo measure bench --seconds 5 --region 200,150,240,180 --picture wall.png\n"
            "  relievo measure ball.mcap --shape sphere --region 280,200,80,80 --json");
        return [o](StopSignal& stop) { return run(*o, stop); };
      }};
}

}  // namespace relievo
