// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "base/json_text.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
#include "capture/calibrate/compare_rigs.h"
#include "capture/calibrate/coverage.h"
#include "capture/calibrate/geometry.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/rig_part.h"
#include "capture/field_order_file.h"
#include "capture/rig_file.h"
#include "capture/upright.h"
#include "cli/checks.h"
#include "cli/size_option.h"
#include "server/calibrate_commands.h"
#include "server/calibrate_live.h"
#include "server/calibrate_views.h"
#include "server/calibration_report.h"
#include "server/camera_flags.h"
#include "server/options.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string views;
  std::string board;
  std::string pattern;
  Size projector;
  std::string source;
  CameraOptions camera;
  ProjectorFlags live_projector;
  int live_views = 8;
  std::string out;
  std::string update;
  std::string scan;
  std::optional<double> frame_rate;
  std::string pictures;
  std::string compare;
  int threads = 2;
  bool json = false;
};

/// How the camera scans, which views at rest do not show.
struct Scanning {
  std::optional<Scan> scan;
  std::optional<FieldOrder> field_order;
  bool states_field_order = false;  // by more than what a driver or nothing says
  std::optional<double> frame_rate;
};

/// What is asked for, else as the rig of before has it.
Scanning scanning_of(const Options& options, const RigPart& before) {
  Scanning out{.scan = before.scan, .frame_rate = before.frame_rate};
  if (before.whole) out.field_order = before.whole->field_order;
  if (before.whole) out.states_field_order = states_field_order(options.update);
  if (!options.scan.empty()) out.scan = options.scan == "interlaced" ? Scan::kInterlaced : Scan::kProgressive;
  if (!options.camera.field_order.empty()) {
    out.field_order = field_order_named(options.camera.field_order);
    out.states_field_order = true;
  }
  if (options.frame_rate) out.frame_rate = options.frame_rate;
  return out;
}

/// The flags of what nothing says, and is assumed therefore.
std::vector<std::string> assumed(const Scanning& scanning) {
  std::vector<std::string> out;
  if (!scanning.scan) out.emplace_back("--scan");
  if (!scanning.frame_rate) out.emplace_back("--frame-rate");
  return out;
}

void set_scanning(const Scanning& scanning, Rig& rig) {
  rig.scan = scanning.scan.value_or(Scan::kInterlaced);
  rig.field_order = scanning.field_order.value_or(FieldOrder::kTop);
  rig.frame_rate = scanning.frame_rate.value_or(29.97);
}

struct Outcome {
  const Geometry& geometry;
  const Rig& rig;
  std::vector<std::string> assumed;
  std::optional<RigDifference> difference;
  std::string file;
};

void print_json(const Outcome& outcome) {
  const auto& [g, rig, assumed, d, file] = outcome;
  auto json = nlohmann::json::parse(geometry_report(g));
  json["rig"] = file;
  json["scan"] = to_string(rig.scan);
  json["field_order"] = to_string(rig.field_order);
  json["frame_rate"] = rig.frame_rate;
  json["assumed"] = assumed;
  if (d) {
    json["compare"] = {{"camera_focal_percent", 100 * d->camera_focal},
                       {"projector_focal_percent", 100 * d->projector_focal},
                       {"camera_centre_px", d->camera_centre_px},
                       {"projector_centre_px", d->projector_centre_px},
                       {"baseline_mm", 1000 * d->baseline_m},
                       {"rotation_deg", d->rotation_rad * 180 / std::numbers::pi},
                       {"depth_rms_mm", 1000 * d->depth_rms_m},
                       {"depth_mean_mm", 1000 * d->depth_mean_m},
                       {"scanning", d->scanning}};
  }
  std::puts(json_text(json).c_str());
}

void print_lens(const char* name, const PinholeModel& lens, const double* sigma) {
  std::printf("%s  focal %.1f x %.1f px (+- %.1f), centre (%.1f, %.1f) px (+- %.1f, %.1f)\n", name, lens.fx(),
              lens.fy(), sigma[0], lens.cx(), lens.cy(), sigma[2], sigma[3]);
}

void print_scanning(const Rig& rig, const std::vector<std::string>& assumed) {
  const char* order = rig.scan == Scan::kProgressive           ? ""
                      : rig.field_order == FieldOrder::kBottom ? ", bottom field first"
                                                               : ", top field first";
  std::printf("scan       %s%s, %.6g frames a second\n", std::string(to_string(rig.scan)).c_str(), order,
              rig.frame_rate);
  if (assumed.empty()) return;
  const std::string flags = assumed.front() + (assumed.size() > 1 ? " and " + assumed.back() : "");
  std::printf("           as usual, since nothing says it: give %s where it is otherwise\n", flags.c_str());
}

void print(const Outcome& outcome) {
  const auto& [g, rig, assumed, d, file] = outcome;
  std::printf("view                  corners  camera  projector  stereo   plane\n");
  for (const ViewReport& r : g.reports) {
    if (r.used) {
      std::printf("%-20s  %4zu/%-3zu %5.3f      %5.3f   %5.3f px  %.2f mm\n", r.name.c_str(),
                  r.corners - r.corners_left_out, r.corners, r.camera_rms, r.projector_rms, r.stereo_rms,
                  1000 * r.plane_rms_m);
    } else {
      std::printf("%-20s  left out: %s\n", r.name.c_str(), r.why.c_str());
    }
  }
  std::printf("all                   %4zu     %5.3f      %5.3f   %5.3f px  %.2f mm\n", g.corners,
              g.camera_rms, g.projector_rms, g.stereo_rms, 1000 * g.plane_rms_m);
  std::printf("           %.3f px with the corners left out of these views\n", g.stereo_rms_all);
  std::printf("squares    distances between neighbouring corners are wrong by %.2f mm (RMS)\n",
              1000 * g.square_error_m);
  std::printf("size       of the board is wrong by %.3f %% (RMS over the views)\n", 100 * g.scale_error);
  print_lens("camera   ", g.camera, g.sigma_px.data());
  print_lens("projector", g.projector, g.sigma_px.data() + 4);
  if (g.projector.cy() < 0 || g.projector.cy() > g.projector.height - 1) {
    std::printf(
        "           its centre is above or below its picture, as projectors that throw upwards have it\n");
  }
  std::printf("depth      at %.2f m is known to +- %.2f mm\n", g.distance_m, 1000 * g.depth_sigma_m);
  const auto& t = g.projector_from_camera_translation;
  std::printf("baseline   %.1f mm\n", 1000 * std::hypot(t[0], t[1], t[2]));
  print_scanning(rig, assumed);
  if (d) {
    std::printf(
        "compared   focal lengths off by %.2f %% and %.2f %%, centres by %.1f and %.1f px (camera, "
        "projector);\n",
        100 * d->camera_focal, 100 * d->projector_focal, d->camera_centre_px, d->projector_centre_px);
    std::printf("           baseline off by %.2f mm, rotation by %.3f degrees;\n", 1000 * d->baseline_m,
                d->rotation_rad * 180 / std::numbers::pi);
    std::printf("           so depth at %.2f m is off by %.2f mm (RMS), %+.2f mm on average\n", g.distance_m,
                1000 * d->depth_rms_m, 1000 * d->depth_mean_m);
    for (const std::string& other : d->scanning) std::printf("           %s\n", other.c_str());
  }
  std::printf("written    %s\n", file.c_str());
}

/// Where views are too few or too alike, all figures of how well they fit are good.
void warn_of_depth(const Geometry& g, const MeasuredViews& measured, const PinholeModel& projector) {
  if (g.depth_sigma_m <= kGoodDepthSigma * g.distance_m) return;
  Coverage coverage(measured.camera, projector);
  for (const MeasuredView& view : measured.views)
    if (!view.corners.empty()) coverage.add(view);
  const std::string missing = coverage.missing();
  char text[96];
  std::snprintf(text, sizeof text,
                "at %.2f m this rig's depths are known to +- %.1f mm only: take more views", g.distance_m,
                1000 * g.depth_sigma_m);
  log_warning(text + (missing.empty() ? "" : "; still missing: " + missing));
}

/// A pattern laid over another size than was projected fits where it can be read, and is far off elsewhere.
void warn_of_size(const Geometry& g) {
  if (g.stereo_rms_all <= GeometryOptions{}.most_rms_px) return;
  char rms[32];
  std::snprintf(rms, sizeof rms, "%.1f", g.stereo_rms_all);
  log_warning(std::string("the corners left out are far off, ") + rms +
              " px RMS with them: was the projector's size " + std::to_string(g.projector.width) + "x" +
              std::to_string(g.projector.height) + ", and the pattern the one that is given?");
}

/// What lies beside a view's pictures is taken for one of them, and a folder beside the views for a view.
Status check_no_view(const fs::path& pictures, const fs::path& views) {
  std::error_code ignored;
  const fs::path within =
      fs::weakly_canonical(pictures, ignored).lexically_relative(fs::weakly_canonical(views, ignored));
  if (within.empty() || within == "." || *within.begin() == "..") return {};
  return Error{pictures.string() + " is among the views: give residuals.png a folder of its own"};
}

Status run(const Options& options, StopSignal& stop) {
  auto board = parse_board(options.board);
  if (!board) return board.error();
  RigPart before;
  if (!options.update.empty()) {
    auto part = rig_to_update(options.update);
    if (!part) return part.error();
    before = *part;
  }
  std::optional<Rig> reference;
  if (!options.compare.empty()) {
    auto read = read_rig(options.compare);
    if (!read) return read.error();
    reference = *read;
  }
  NewFolder pictures;
  if (!options.pictures.empty()) {
    if (const Status apart = check_no_view(options.pictures, options.views); !apart) return apart;
    if (const Status made = pictures.make(options.pictures); !made) return made;
  }
  const std::string out = options.out.empty() ? options.update : options.out;
  ViewCode code{.stripes = {}, .projector = options.projector};
  code.colours = before.colours.value_or(CameraColours{});
  Scanning scanning = scanning_of(options, before);
  if (!options.source.empty()) {
    CameraOptions camera = options.camera;
    if (options.pattern != "gray") camera.pattern = options.pattern;
    camera.projector_width = options.projector.width;
    camera.projector_height = options.projector.height;
    if (scanning.states_field_order) camera.field_order = to_string(*scanning.field_order);
    const auto taken = take_board_views({.source = options.source,
                                         .camera = camera,
                                         .folder = options.views,
                                         .views = options.live_views,
                                         .threads = options.threads,
                                         .colours = code.colours,
                                         .projector = options.live_projector.choice()},
                                        *board, stop);
    if (!taken) return taken.error();
    if (stop.stopped()) return {};
    code.projector = {taken->rig.projector.width, taken->rig.projector.height};
    if (!scanning.scan) scanning.scan = taken->rig.scan;
    if (!scanning.frame_rate) scanning.frame_rate = taken->rig.frame_rate;
    scanning.field_order = taken->rig.field_order;  // it was captured so, the flag heeded
  }
  code.field_order = scanning.field_order.value_or(FieldOrder::kTop);
  auto stripes = stripes_of(options.views, options.pattern);
  if (!stripes) return stripes.error();
  code.stripes = *std::move(stripes);
  auto measured = measure_views(options.views, code, *board, options.threads, stop);
  if (stop.stopped()) {
    log_info("stopped: nothing was written to " + out);
    return {};
  }
  if (!measured) return measured.error();
  PinholeModel projector;
  projector.width = code.projector.width;
  projector.height = code.projector.height;
  if (measured->of_fields) {
    if (scanning.scan == Scan::kProgressive)
      return Error{
          "the views are frames of an interlaced camera, a picture a slide, and its scan is said to be "
          "progressive: say --scan interlaced, or give each slide and its complement as a picture"};
    scanning.scan = Scan::kInterlaced;
  }
  const auto geometry = calibrate_geometry(measured->views, measured->camera, projector, {});
  if (!geometry && measured->of_fields && !scanning.field_order)
    return Error{geometry.error().message +
                 "; or does the camera's bottom field come first (--field-order bottom)?"};
  if (!geometry) return geometry.error();
  warn_of_depth(*geometry, *measured, projector);

  Rig rig = before.whole.value_or(Rig{});
  set_scanning(scanning, rig);
  set_colours(code.colours, rig);
  rig = with_geometry(rig, *geometry);
  if (!options.pictures.empty()) {
    const Status drawn = write_png(fs::path(options.pictures) / "residuals.png", draw_residuals(*geometry));
    if (!drawn) return drawn;
  }
  std::optional<RigDifference> difference;
  if (reference) {
    auto compared = compare_rigs(rig, *reference, geometry->distance_m);
    if (!compared) return compared.error().in(options.compare);
    difference = *compared;
  }
  // Last: what fails before it leaves the rig of before.
  const std::string yaml = scanning.states_field_order ? with_field_order(to_yaml(rig), rig) : to_yaml(rig);
  if (const Status written = write_whole_file(out, yaml); !written) return written;
  if (const auto seen = upright(rig, {}); !seen) log_warning(seen.error().message);
  const Outcome outcome{*geometry, rig, assumed(scanning), difference, out};
  if (options.json) {
    print_json(outcome);
  } else {
    print(outcome);
  }
  warn_of_size(*geometry);
  return {};
}

}  // namespace

std::function<Status(StopSignal&)> define_calibrate_geometry(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("views", o->views,
                 "Folder of views, each a folder of pictures of the board under the pattern")
      ->required();
  add_board_option(
      app, o->board,
      "chessboard:COLUMNSxROWS:SIDE, inner corners and a square's side, e.g. chessboard:9x7:75mm; or "
      "charuco:COLUMNSxROWS:SIDE:MARKER[:DICTIONARY], squares, e.g. charuco:10x8:30mm:22mm:5X5_100")
      ->required();
  app.add_option(
      "--pattern", o->pattern,
      "What was projected: gray, or the pattern.yaml of stripes (default: the one in the folder of "
      "views, else gray)");
  auto* projector = add_size_option(app, "--projector", o->projector,
                                    "The projector's size in pixels, unless --source knows it");
  auto* source =
      app.add_option("--source", o->source,
                     "Take the views from a live source first, into the folder of views: a board held "
                     "still at one pose after another, under the stripes along columns and rows");
  app.add_option("--views", o->live_views, "Views to take from --source")
      ->check(CLI::Range(3, 1000))
      ->needs(source)
      ->capture_default_str();
  add_live_projector_options(app, *source, o->live_projector);
  auto* out = app.add_option("-o,--out", o->out, "The rig.yaml to write");
  auto* update =
      app.add_option("--update", o->update,
                     "A rig.yaml, or one with colours only: keep its scan, field order, frame rate and "
                     "colour matrix; written back unless --out says otherwise");
  app.add_option("--scan", o->scan,
                 "How the camera scans (default: as the rig to update or the source has it, else interlaced)")
      ->check(CLI::IsMember({"interlaced", "progressive"}));
  app.add_option("--frame-rate", o->frame_rate,
                 "Frames a second (default: those of the rig to update or the source, else 29.97)")
      ->check(number(0.001, 10000));
  app.add_option("--pictures", o->pictures, "Folder for residuals.png");
  app.add_option("--compare", o->compare,
                 "Another rig.yaml of the same devices: report how far this one is from it");
  app.add_option("--threads", o->threads, "Threads; any number gives the same result")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  add_camera_flags(app, o->camera);
  app.get_option("--field-order")
      ->description(
          "The field of an interlaced camera that is exposed first, in views and in the rig.yaml (default: "
          "as the rig to update or the source has it, else top)");
  app.add_flag("--json", o->json, "Print the report as JSON");
  app.final_callback([out, update, projector, source] {
    if (out->empty() && update->empty()) throw CLI::RequiredError("--out or --update");
    if (projector->empty() && source->empty()) throw CLI::RequiredError("--projector");
  });
  return [o](StopSignal& stop) { return run(*o, stop); };
}

}  // namespace relievo
