// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
#include "capture/calibrate/gray_stack.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/ray_pairs.h"
#include "capture/calibrate/rig_import.h"
#include "capture/source/npy.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/size_option.h"
#include "server/commands.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string folder;
  std::string out;
  Size projector;
  std::string calibration;
  double max_gap_mm = 0;
  std::string compare;
  std::string compare_unit = "mm";
  GrayDecodeOptions decode;
  int threads = 2;
  bool json = false;
};

/// Of distances, in millimetres.
struct Quantiles {
  double median = 0, p90 = 0;
};

Quantiles quantiles_of(std::vector<float> metres) {
  const auto at = [&](double share) {
    if (metres.empty()) return 0.0;
    const auto nth =
        metres.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(metres.size() - 1));
    std::nth_element(metres.begin(), nth, metres.end());
    return 1000.0 * double{*nth};
  };
  return {at(0.5), at(0.9)};
}

struct Report {
  std::size_t lit = 0, decoded = 0, uncertain = 0, lone = 0;
  std::optional<std::size_t> points;
  std::size_t apart = 0;
  Quantiles gap;
  std::optional<std::size_t> reference_points;
  Quantiles nearest;
};

void print(const Report& r, const Options& options) {
  if (options.json) {
    nlohmann::json out = {{"lit_pixels", r.lit},
                          {"decoded_pixels", r.decoded},
                          {"uncertain_pixels", r.uncertain},
                          {"lone_pixels", r.lone}};
    if (r.points) {
      out["points"] = *r.points;
      out["apart"] = r.apart;
      out["ray_gap_mm"] = {{"median", r.gap.median}, {"p90", r.gap.p90}};
    }
    if (r.reference_points) {
      out["compare"] = {{"points", *r.reference_points},
                        {"nearest_mm", {{"median", r.nearest.median}, {"p90", r.nearest.p90}}}};
    }
    std::puts(json_text(out).c_str());
    return;
  }
  std::printf("decoded     %zu of %zu lit pixels (%zu with an unclear bit, %zu unlike all around)\n",
              r.decoded, r.lit, r.uncertain, r.lone);
  if (r.points) {
    std::printf("points      %zu (%zu left out: their rays miss each other)\n", *r.points, r.apart);
    std::printf("ray gap     median %.3f mm, 90 %% under %.3f mm\n", r.gap.median, r.gap.p90);
  }
  if (r.reference_points) {
    std::printf("compared    nearest of %zu points: median %.3f mm, 90 %% under %.3f mm\n",
                *r.reference_points, r.nearest.median, r.nearest.p90);
  }
  std::printf("written to  %s\n", options.out.c_str());
}

/// The reference in our units and axes: clouds whose points lie at negative z have y up and z backwards.
Result<PointCloud> read_reference(const std::string& file, const std::string& unit) {
  auto cloud = read_ply_points(file);
  if (!cloud) return cloud;
  if (cloud->positions.empty()) return Error{file + " has no points to compare with"};
  const auto behind = static_cast<std::size_t>(std::count_if(cloud->positions.begin(), cloud->positions.end(),
                                                             [](const Vec3f& p) { return p[2] < 0; }));
  const float scale = unit == "mm" ? 0.001f : 1.0f;
  const float flip = 2 * behind > cloud->positions.size() ? -scale : scale;
  for (Vec3f& p : cloud->positions) p = {scale * p[0], flip * p[1], flip * p[2]};
  return cloud;
}

/// Clouds of which one is in another unit have no distances worth a figure.
Status check_units(const PointCloud& cloud, const PointCloud& reference, const Options& options) {
  constexpr float kOther = 100;
  const float own = spread_of(cloud.positions), other = spread_of(reference.positions);
  if (own == 0 || other == 0 || (other > own / kOther && other < own * kOther)) return {};
  char times[32];
  std::snprintf(times, sizeof times, "%.0f", double{std::max(own / other, other / own)});
  return Error{options.compare + " is " + times + " times " + (other < own ? "smaller" : "larger") +
               " than what these pictures show: --compare-unit " +
               (options.compare_unit == "mm" ? "m" : "mm") + "?"};
}

Result<DensePoints> triangulate(const Options& options, const Rig& rig, const GrayMaps& maps,
                                const Image8& picture, Report& report) {
  if (rig.camera.width != picture.width() || rig.camera.height != picture.height()) {
    return Error{options.calibration + " is of a camera of " + std::to_string(rig.camera.width) + "x" +
                 std::to_string(rig.camera.height) + ", the pictures are " + std::to_string(picture.width()) +
                 "x" + std::to_string(picture.height())};
  }
  DensePoints dense = triangulate_maps(rig, maps.columns, maps.rows, picture, options.max_gap_mm / 1000);
  if (dense.cloud.positions.empty()) {
    return Error{"no ray of the camera meets its projector ray: does " + options.calibration +
                 " belong to these pictures?"};
  }
  report.points = dense.cloud.positions.size();
  report.apart = dense.apart;
  report.gap = quantiles_of(dense.gap_m);
  return dense;
}

/// Results from pictures of which some are not what they should be look like results.
void warn_of_pictures(const GrayStack& stack, const GrayMaps& maps, const Options& options) {
  const std::vector<GraySlide> flat = flat_bits(stack, options.decode);
  for (const GraySlide& slide : flat) {
    log_warning("the pictures of " + to_string(slide) +
                " and of its inverse hardly differ: is one a copy of the other, or are they out of focus?");
  }
  if (const std::string beyond = beyond_projector(stack, maps); !beyond.empty()) {
    log_warning(beyond);
    return;
  }
  if (!flat.empty() || 10 * maps.decoded >= maps.lit) return;
  log_warning(
      "only " + std::to_string(maps.decoded) + " of " + std::to_string(maps.lit) +
      " lit pixels could be decoded: are the pictures in the order of projection, --projector right, and did "
      "nothing move?");
}

Error nothing_decoded(const GrayStack& stack, const GrayMaps& maps, const Options& options) {
  constexpr int kDark = 32;  // of 255; 12 bits come to 15 where they are the lower ones of 16
  const Image8& picture = stack.picture;
  const int brightest = *std::max_element(picture.data(), picture.data() + picture.size());
  const std::string nothing = "nothing in " + options.folder + " could be decoded: ";
  if (brightest < kDark)
    return Error{
        nothing + "the pictures are dark, " + std::to_string(brightest) +
        " of 255 at their brightest; expose them for longer, or, where 10 or 12 bits lie in files of "
        "16, multiply them by 64 or 16"};
  return Error{nothing + std::to_string(maps.lit) +
               " pixels are lit by the projector; check the pictures' order, or lower --min-contrast"};
}

/// Both rays of a point are told by other pictures: of a calibration that fits they meet within a pixel or
/// two.
void warn_of_gap(const DensePoints& dense, const Report& report, const Options& options) {
  constexpr double kMostOfDepth = 0.003;  // of some pixels
  std::vector<float> depths;
  for (const Vec3f& p : dense.cloud.positions) depths.push_back(p[2]);
  const double depth_mm = quantiles_of(std::move(depths)).median;
  if (report.gap.median <= kMostOfDepth * depth_mm) return;
  char text[96];
  std::snprintf(text, sizeof text, "half of the rays miss each other by %.1f mm or more, %.0f mm away",
                report.gap.median, depth_mm);
  log_warning(text + (": does " + options.calibration) +
              " belong to these pictures, and is none of them in the place of another?");
}

/// Where results go among the pictures, none of these is replaced.
Status check_picture(const Options& options) {
  std::error_code ignored;
  if (!fs::equivalent(options.folder, options.out, ignored) || is_imported(options.folder)) return {};
  const fs::path picture = fs::path(options.out) / kImportedPicture;
  if (!fs::exists(picture, ignored)) return {};
  return Error{picture.string() +
               " is one of the pictures, and would be replaced: give --out another folder"};
}

Status stopped(const Options& options) {
  log_info("stopped: nothing was written to " + options.out);
  return {};
}

Status run(const Options& options, StopSignal& stop) {
  if (const Status kept = check_picture(options); !kept) return kept;
  std::optional<ImportedRig> rig;
  if (!options.calibration.empty()) {
    auto imported = import_rig(options.calibration, options.projector.width, options.projector.height);
    if (!imported) return imported.error();
    rig = *imported;
    log_info(options.calibration + ": a calibration of " + rig->format);
  }
  std::optional<PointCloud> reference;
  if (!options.compare.empty()) {
    auto read = read_reference(options.compare, options.compare_unit);
    if (!read) return read.error();
    reference = *std::move(read);
  }
  const Size projector = rig ? Size{rig->rig.projector.width, rig->rig.projector.height} : options.projector;

  Progress progress("import", "pictures",
                    2 * static_cast<std::uint64_t>(gray_bits(projector.width) + gray_bits(projector.height)));
  auto stack =
      read_gray_stack(options.folder, projector.width, projector.height, [&](std::size_t done, std::size_t) {
        progress.update(done);
        return !stop.stopped();
      });
  progress.finish();
  if (stop.stopped()) return stopped(options);
  if (!stack) return stack.error();
  WorkerPool pool(options.threads);
  auto maps = decode_gray(*stack, options.decode, pool);
  if (!maps) return maps.error().in(options.folder);
  if (maps->decoded == 0) return nothing_decoded(*stack, *maps, options);
  if (stop.stopped()) return stopped(options);
  warn_of_pictures(*stack, *maps, options);
  Report report{.lit = maps->lit, .decoded = maps->decoded, .uncertain = maps->uncertain, .lone = maps->lone};
  std::optional<DensePoints> dense;
  if (rig) {
    auto points = triangulate(options, rig->rig, *maps, stack->picture, report);
    if (!points) return points.error();
    dense = *std::move(points);
    warn_of_gap(*dense, report, options);
  }
  if (reference) {
    if (const Status same = check_units(dense->cloud, *reference, options); !same) return same;
    report.reference_points = reference->positions.size();
    report.nearest = quantiles_of(nearest_distances(dense->cloud.positions, reference->positions));
  }
  const auto folder = NewFolder::create(options.out);
  if (!folder) return folder.error();
  const fs::path out = options.out;
  if (const Status s = write_npy(out / kImportedColumns, maps->columns); !s) return s;
  if (const Status s = write_npy(out / kImportedRows, maps->rows); !s) return s;
  if (const Status s = write_png(out / kImportedPicture, stack->picture); !s) return s;
  if (rig) {
    if (const Status s = write_ply_points(out / "points.ply", dense->cloud); !s) return s;
    std::error_code ignored;
    const bool is_own = fs::equivalent(options.calibration, out / "rig.yaml", ignored);  // it may say more
    if (const Status s = is_own ? Status() : write_whole_file(out / "rig.yaml", to_yaml(rig->rig)); !s)
      return s;
  }
  print(report, options);
  return {};
}

void define_gray(CLI::App& app, const std::shared_ptr<Options>& o) {
  app.add_option("folder", o->folder,
                 "Folder of pictures: named [AXIS-BIT-INVERSE], or in the order of projection")
      ->required();
  app.add_option(
         "-o,--out", o->out,
         "Folder for columns.npy, rows.npy, picture.png, points.ply, rig.yaml; may be the folder of pictures")
      ->required();
  auto* projector = add_size_option(app, "--projector", o->projector,
                                    "The projector's size in pixels, unless --calibration knows it");
  auto* calibration =
      app.add_option("--calibration", o->calibration,
                     "rig.yaml, or the result of sltk or procam-calibration: also makes points");
  app.add_option("--max-gap", o->max_gap_mm,
                 "Leave out points whose two rays miss each other by more, mm; 0: none")
      ->check(number(0))
      ->capture_default_str();
  app.add_option("--compare", o->compare, "PLY cloud: report the distance of each point to its nearest point")
      ->needs(calibration);
  app.add_option("--compare-unit", o->compare_unit, "Unit of that cloud")
      ->check(CLI::IsMember({"mm", "m"}))
      ->capture_default_str();
  app.add_option("--min-contrast", o->decode.min_contrast, "Least difference of a lit pixel, of 255")
      ->check(CLI::Range(1, 255))
      ->capture_default_str();
  app.add_option("--window", o->decode.window_px,
                 "Half the side of the sub-pixel window, pixels; 0: whole columns")
      ->check(CLI::Range(0, 16))
      ->capture_default_str();
  app.add_option("--threads", o->threads, "Threads; any number gives the same result")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_flag("--json", o->json, "Print the summary as JSON");
  app.final_callback([projector, calibration] {
    if (projector->empty() && calibration->empty()) throw CLI::RequiredError("--projector or --calibration");
  });
}

}  // namespace

Command import_command() {
  return {"import", "Import what other programs captured", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.require_subcommand(1);
            app.fallthrough();
            auto* gray =
                app.add_subcommand("gray", "Decode a folder of Gray-code pictures: columns, rows and points");
            gray->fallthrough();
            define_gray(*gray, options);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
