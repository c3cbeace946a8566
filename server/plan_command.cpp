// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>

#include "base/json_text.h"
#include "capture/plan/plan.h"
#include "capture/rig_file.h"
#include "capture/upright.h"
#include "cli/checks.h"
#include "cli/size_option.h"
#include "server/commands.h"
#include "server/options.h"
#include "server/pattern_options.h"

namespace relievo {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct Options {
  std::string rig;
  Size camera{640, 480};
  Size projector{1024, 768};
  std::string scan = "interlaced";
  double frame_rate = 29.97;
  double camera_view_deg = 34;
  std::optional<double> lens_mm, sensor_mm, projector_view_deg;
  double throw_ratio = 1.46;
  double baseline_m = 0.2;
  double distance_m = 1;
  std::optional<double> near_m, far_m;
  double camera_aperture_mm = 0, projector_aperture_mm = 0, exposure_ms = 0;
  PatternOptions pattern;
  PlanConditions conditions;
  bool json = false;
};

Result<Rig> rig_of(const Options& o) {
  if (!o.rig.empty()) {
    auto rig = read_rig(o.rig);
    if (!rig) return rig.error();
    auto seen = upright(*rig, {});
    if (!seen) return seen.error().in(o.rig);
    return std::move(seen->rig);
  }
  RigSketch sketch;
  sketch.scan = o.scan == "interlaced" ? Scan::kInterlaced : Scan::kProgressive;
  sketch.frame_rate = o.frame_rate;
  sketch.camera_width = o.camera.width;
  sketch.camera_height = o.camera.height;
  sketch.camera_view_rad =
      o.lens_mm ? 2 * std::atan(*o.sensor_mm / 2 / *o.lens_mm) : o.camera_view_deg * kDegree;
  sketch.projector_width = o.projector.width;
  sketch.projector_height = o.projector.height;
  sketch.projector_view_rad =
      o.projector_view_deg ? *o.projector_view_deg * kDegree : 2 * std::atan(0.5 / o.throw_ratio);
  sketch.baseline_m = o.baseline_m;
  sketch.distance_m = o.distance_m;
  return sketch_rig(sketch);
}

nlohmann::json json_of(const PlanAtDepth& at) {
  return {{"depth_m", at.depth_m},
          {"view_width_m", at.view_width_m},
          {"view_height_m", at.view_height_m},
          {"lit", at.lit},
          {"stripe_px", at.stripe_px},
          {"stripe_m", at.stripe_m},
          {"metres_per_px", at.metres_per_px},
          {"blur_px", at.blur_px},
          {"focus_blur_px", at.focus_blur_px},
          {"motion_blur_px", at.motion_blur_px},
          {"motion_frame_px", at.motion_frame_px},
          {"bound_px", at.bound_px},
          {"sigma_px", at.sigma_px},
          {"sigma_m", at.sigma_m}};
}

nlohmann::json json_of(const DepthSpan& span) {
  nlohmann::json out = {{"near_m", span.near_m}, {"far_m", nullptr}};
  if (span.far_m) out["far_m"] = *span.far_m;
  return out;
}

void print_json(const Plan& plan, const Rig& rig, const Pattern& pattern) {
  const nlohmann::json out = {{"camera_width", rig.camera.width},
                              {"camera_height", rig.camera.height},
                              {"camera_focal_px", rig.camera.fx()},
                              {"projector_width", rig.projector.width},
                              {"projector_focal_px", rig.projector.fx()},
                              {"stripes", pattern.stripes()},
                              {"recommended_stripes", plan.recommended_stripes},
                              {"near", json_of(plan.at[0])},
                              {"distance", json_of(plan.at[1])},
                              {"far", json_of(plan.at[2])},
                              {"codes_unique", plan.unique},
                              {"one_slide_one_boundary", json_of(plan.one_boundary)},
                              {"one_slide_three_boundaries", json_of(plan.three_boundaries)},
                              {"warnings", plan.warnings}};
  std::puts(json_text(out).c_str());
}

std::string span_text(const DepthSpan& span) {
  char text[64];
  if (span.far_m)
    std::snprintf(text, sizeof text, "%.2f to %.2f m", span.near_m, *span.far_m);
  else
    std::snprintf(text, sizeof text, "from %.2f m on", span.near_m);
  return text;
}

void print_table(const Plan& plan, const Pattern& pattern) {
  struct Row {
    const char* name;
    int digits;
    double scale;
    double PlanAtDepth::*value;
  };
  constexpr Row kRows[] = {
      {"depth, m", 3, 1, &PlanAtDepth::depth_m},
      {"field of view, m wide", 3, 1, &PlanAtDepth::view_width_m},
      {"field of view, m high", 3, 1, &PlanAtDepth::view_height_m},
      {"lit by the projector, %", 0, 100, &PlanAtDepth::lit},
      {"stripe, camera px", 2, 1, &PlanAtDepth::stripe_px},
      {"stripe, mm", 2, 1e3, &PlanAtDepth::stripe_m},
      {"depth a px, mm", 2, 1e3, &PlanAtDepth::metres_per_px},
      {"edge blur (sigma), px", 2, 1, &PlanAtDepth::blur_px},
      {"  of which focus", 2, 1, &PlanAtDepth::focus_blur_px},
      {"motion: smear of texture, px", 2, 1, &PlanAtDepth::motion_blur_px},
      {"motion: stripe a frame, px", 2, 1, &PlanAtDepth::motion_frame_px},
      {"boundary: bound of sigma, px", 4, 1, &PlanAtDepth::bound_px},
      {"boundary: sigma, px", 4, 1, &PlanAtDepth::sigma_px},
      {"depth: sigma, um", 0, 1e6, &PlanAtDepth::sigma_m},
  };
  for (const Row& row : kRows) {
    std::printf("%-30s", row.name);
    for (const PlanAtDepth& at : plan.at) std::printf(" %10.*f", row.digits, at.*row.value * row.scale);
    std::printf("\n");
  }
  if (plan.unique) {
    std::printf("%d stripes: no code repeats, so depth is unambiguous wherever both see\n",
                pattern.stripes());
  } else {
    std::printf("%d stripes: codes repeat\n", pattern.stripes());
  }
  std::printf("one slide alone (fast motion): unambiguous %s by one boundary, %s by three in a row\n",
              span_text(plan.one_boundary).c_str(), span_text(plan.three_boundaries).c_str());
  std::printf("recommended: %d stripes\n", plan.recommended_stripes);
  for (const std::string& warning : plan.warnings) std::printf("warning: %s\n", warning.c_str());
}

Status run(const Options& o) {
  const auto rig = rig_of(o);
  if (!rig) return rig.error();
  const auto pattern = pattern_of(o.pattern);
  if (!pattern) return pattern.error();
  if (const Status fits = fits_projector(*pattern, rig->projector.width); !fits) return fits;
  PlanConditions conditions = o.conditions;
  conditions.distance_m = o.distance_m;
  conditions.near_m = o.near_m.value_or(0.8 * o.distance_m);
  conditions.far_m = o.far_m.value_or(1.25 * o.distance_m);
  conditions.camera_aperture_m = o.camera_aperture_mm * 1e-3;
  conditions.projector_aperture_m = o.projector_aperture_mm * 1e-3;
  conditions.exposure_s = o.exposure_ms * 1e-3;
  const auto plan = make_plan(*rig, *pattern, conditions);
  if (!plan) return plan.error();
  if (o.json) {
    print_json(*plan, *rig, *pattern);
  } else {
    print_table(*plan, *pattern);
  }
  return {};
}

void add_rig_options(CLI::App& app, Options& o) {
  auto* rig = app.add_option("--rig", o.rig, "A calibrated rig.yaml instead of the lenses and places below")
                  ->type_name("FILE");
  const auto positive = number(1e-6, 1e6);
  const auto optional_number = [&](const char* name, std::optional<double>& value, const char* help) {
    return app.add_option(name, value, help)->check(positive)->excludes(rig);
  };
  add_size_option(app, "--camera", o.camera, "The camera's pixels (default 640x480)")->excludes(rig);
  app.add_option("--scan", o.scan, "How the camera takes a frame's two fields")
      ->check(CLI::IsMember({"interlaced", "progressive"}))
      ->capture_default_str()
      ->excludes(rig);
  app.add_option("--rate", o.frame_rate, "Frames (field pairs) a second")
      ->check(number(0.1, 1000))
      ->capture_default_str()
      ->excludes(rig);
  auto* view = app.add_option("--camera-fov", o.camera_view_deg, "Horizontal field of view, degrees")
                   ->check(number(1, 160))
                   ->capture_default_str()
                   ->excludes(rig);
  auto* lens = optional_number("--lens-mm", o.lens_mm, "Or the camera lens's focal length, mm");
  auto* sensor = optional_number("--sensor-mm", o.sensor_mm, "And the sensor's width, mm");
  lens->needs(sensor)->excludes(view);
  sensor->needs(lens);
  add_size_option(app, "--projector", o.projector, "The projector's pixels (default 1024x768)")
      ->excludes(rig);
  auto* ratio = app.add_option("--throw", o.throw_ratio, "Projector's throw ratio: distance over width")
                    ->check(number(0.1, 20))
                    ->capture_default_str()
                    ->excludes(rig);
  app.add_option("--projector-fov", o.projector_view_deg, "Or its horizontal field of view, degrees")
      ->check(number(1, 160))
      ->excludes(ratio)
      ->excludes(rig);
  app.add_option("--baseline", o.baseline_m, "Camera lens to projector lens, m")
      ->check(positive)
      ->capture_default_str()
      ->excludes(rig);
}

void add_condition_options(CLI::App& app, Options& o) {
  const auto positive = number(1e-6, 1e6);
  const auto at_least_0 = number(0, 1e6);
  const auto add = [&](const char* name, double& value, const ValueCheck& check, const char* help) {
    app.add_option(name, value, help)->check(check)->capture_default_str();
  };
  add("--distance", o.distance_m, positive, "Where camera and projector aim and are focused, m");
  app.add_option("--near", o.near_m, "Nearest depth, m (default 0.8 of the distance)")->check(positive);
  app.add_option("--far", o.far_m, "Farthest depth, m (default 1.25 of the distance)")->check(positive);
  add("--level", o.conditions.level, number(1, 255), "What the projector's white adds to a pixel, of 255");
  add("--noise", o.conditions.noise, number(0.01, 100), "Standard deviation of a pixel, of 255");
  add("--camera-blur", o.conditions.camera_blur_px, at_least_0,
      "Sigma of lens, chroma and debayering, camera pixels");
  add("--projector-blur", o.conditions.projector_blur_px, at_least_0, "Sigma, projector pixels");
  add("--camera-aperture-mm", o.camera_aperture_mm, at_least_0,
      "Diameter of the camera's pupil (focal length over f-number); 0: in focus everywhere");
  add("--projector-aperture-mm", o.projector_aperture_mm, at_least_0, "The same of the projector");
  add("--exposure-ms", o.exposure_ms, at_least_0, "Exposure of a field; 0: as long as a field");
  add("--speed", o.conditions.speed_m_s, at_least_0, "Fastest motion, m/s");
}

}  // namespace

Command plan_command() {
  return {"plan", "Calculate what a rig will see: view, stripes, depth range, precision, blur",
          [](CLI::App& app) {
            auto o = std::make_shared<Options>();
            add_rig_options(app, *o);
            add_condition_options(app, *o);
            add_pattern_options(app, o->pattern);
            app.final_callback([o] { check_pattern_options(o->pattern); });
            app.add_flag("--json", o->json, "Print the result as JSON, in metres and pixels");
            app.footer(
                "Example:\n  relievo-server plan --camera 1280x720 --scan progressive --rate 60 --lens-mm 12 "
                "--sensor-mm 7.2 --projector 1920x1080 --throw 1.5 --distance 1.2 --baseline 0.25\n\n"
                "The bound of sigma is the least that noise allows (Cramer-Rao) on one line; sigma is what "
                "the default "
                "decoder reaches, within a factor of two (docs/RIG.md).\n\n" +
                std::string(scheme_help()));
            return [o](StopSignal&) { return run(*o); };
          }};
}

}  // namespace relievo
