// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
#include "capture/calibrate/board_scene.h"
#include "capture/calibrate/colour.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/pattern/bcsl.h"
#include "capture/source/sim/renderer.h"
#include "cli/progress.h"
#include "server/calibrate_commands.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string out;
  std::string spec = "object,distortion=1";
  std::string board = "chessboard:9x7:25mm";
  std::string code = "stripes";
  int views = 8;
  std::uint32_t seed = 1;
  bool json = false;
};

Status write_gray_view(const fs::path& folder, const std::vector<Image8>& pictures) {
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "gray_%02zu.png", i);
    if (const Status written = write_png(folder / name, pictures[i]); !written) return written;
  }
  return {};
}

/// What calibrate geometry cannot see in the views.
std::string scanning_flags(const Rig& rig) {
  char rate[32];
  std::snprintf(rate, sizeof rate, "%.9g", rig.frame_rate);
  std::string out = " --scan " + std::string(to_string(rig.scan)) + " --frame-rate " + rate;
  if (rig.scan == Scan::kInterlaced && rig.field_order == FieldOrder::kBottom) out += " --field-order bottom";
  return out;
}

Status run(const Options& options, StopSignal& stop) {
  auto spec = sim::parse_sim_options(options.spec);
  if (!spec) return spec.error();
  auto scene = sim::make_scene(spec->scene);
  if (!scene) return scene.error();
  auto board = parse_board(options.board);
  if (!board) return board.error();
  const Rig rig = sim::make_rig(*spec, (*scene)->view());
  const double distance_m = (*scene)->view().distance_m;
  const auto poses = example_poses(rig, *board, distance_m, options.views, options.seed);
  if (static_cast<int>(poses.size()) < options.views) {
    return Error{"the board does not fit before the rig at " + std::to_string(options.views) +
                 " poses: use a smaller one, with --board"};
  }
  std::optional<Pattern> stripes;
  if (options.code == "stripes") {
    auto made = make_pattern(spec->base, spec->slides, spec->first, spec->stripes, spec->path);
    if (!made) return made.error();
    stripes = *std::move(made);
  }
  const fs::path out = options.out;
  std::error_code code;
  if (fs::exists(out / "views", code) && !fs::is_empty(out / "views", code)) {
    return Error{(out / "views").string() +
                 " has views of an earlier run, which would be calibrated with these: give a new folder or "
                 "remove it"};
  }
  const auto views = NewFolder::create(out / "views");
  if (!views) return views.error();
  if (stripes) {
    const Status written = write_whole_file(out / "views" / "pattern.yaml", to_yaml(*stripes));
    if (!written) return written;
  }
  Progress progress("example", "views", static_cast<std::uint64_t>(options.views));
  for (int i = 0; i < options.views && !stop.stopped(); ++i) {
    const BoardSceneOptions how{.noise = spec->noise,
                                .ambient = spec->ambient,
                                .chroma = spec->chroma,
                                .seed = options.seed + static_cast<std::uint32_t>(i)};
    const Pose& pose = poses[static_cast<std::size_t>(i)];
    char name[32];
    std::snprintf(name, sizeof name, "view_%02d", i);
    const fs::path folder = out / "views" / name;
    const auto made = NewFolder::create(folder);
    if (!made) return made.error();
    const Status written =
        stripes
            ? write_stripe_view(folder, render_stripe_view(rig, *board, pose, *stripes, spec->defocus, how))
            : write_gray_view(folder, render_gray_view(rig, *board, pose, how));
    if (!written) return written;
    progress.update(static_cast<std::uint64_t>(i) + 1);
  }
  if (stop.stopped()) {
    log_info("stopped: a part of the views is in " + options.out);
    return {};
  }
  const auto colours = NewFolder::create(out / "colours");
  if (!colours) return colours.error();
  for (Primary colour = 0; colour < 8; ++colour) {
    const Image8 picture = render_colour_capture(
        rig, colour, distance_m, {.noise = spec->noise, .ambient = spec->ambient, .seed = options.seed});
    if (const Status written = write_png(out / "colours" / (primary_name(colour) + ".png"), picture);
        !written)
      return written;
  }
  if (const Status written = write_whole_file(out / "truth.yaml", to_yaml(rig)); !written) return written;
  progress.finish();
  const std::string size = std::to_string(rig.projector.width) + "x" + std::to_string(rig.projector.height);
  if (options.json) {
    const nlohmann::json json = {{"views", (out / "views").string()},
                                 {"colours", (out / "colours").string()},
                                 {"truth", (out / "truth.yaml").string()},
                                 {"board", options.board},
                                 {"projector", size},
                                 {"scan", to_string(rig.scan)},
                                 {"field_order", to_string(rig.field_order)},
                                 {"frame_rate", rig.frame_rate}};
    std::puts(json_text(json).c_str());
    return {};
  }
  std::printf("%d views of a board and 8 captures of a white sheet, in %s. Next:\n", options.views,
              options.out.c_str());
  std::printf("  relievo-server calibrate colour %s/colours --out rig.yaml\n", options.out.c_str());
  std::printf(
      "  relievo-server calibrate geometry %s/views --board %s --projector %s%s --update rig.yaml --compare "
      "%s/truth.yaml\n",
      options.out.c_str(), options.board.c_str(), size.c_str(), scanning_flags(rig).c_str(),
      options.out.c_str());
  return {};
}

}  // namespace

std::function<Status(StopSignal&)> define_calibrate_example(CLI::App& app) {
  auto o = std::make_shared<Options>();
  app.add_option("-o,--out", o->out, "Folder for views/, colours/ and truth.yaml")->required();
  app.add_option("--rig", o->spec, "Whose rig, as for sim: sources: SCENE[,key=value...]")
      ->capture_default_str();
  add_board_option(app, o->board, "The board, as calibrate geometry has it")->capture_default_str();
  app.add_option("--code", o->code, "What is projected on the board")
      ->check(CLI::IsMember({"stripes", "gray"}))
      ->capture_default_str();
  app.add_option("--views", o->views, "Poses of the board")->check(CLI::Range(3, 100))->capture_default_str();
  app.add_option("--seed", o->seed, "Of poses and noise")->capture_default_str();
  app.add_flag("--json", o->json, "Print what was written as JSON");
  return [o](StopSignal& stop) { return run(*o, stop); };
}

}  // namespace relievo
