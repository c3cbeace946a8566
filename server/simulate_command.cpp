// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "capture/source/sim/scene.h"
#include "capture/source/sim/sim_options.h"
#include "capture/source/sim/sim_source.h"
#include "capture/source/take_writer.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "server/commands.h"
#include "server/options.h"

namespace relievo {
namespace {

struct Options {
  std::string scene;
  std::string scheme;
  std::uint64_t frames = 0;
  std::string out;
  bool json = false;
};

Status run(const Options& options, StopSignal& stop) {
  const auto named = with_scheme("sim:" + options.scene, options.scheme);
  if (!named) return named.error();
  std::string spec = named->substr(4);
  if (options.frames > 0) spec += ",frames=" + std::to_string(options.frames);
  auto source = make_sim(spec, {.truth = true});
  if (!source) return source.error();
  std::atomic<bool> stopped = false;
  stop.on_stop([&] {
    stopped = true;
    (*source)->request_stop();  // a frame may take long
  });
  std::uint64_t written = 0;
  const std::uint64_t total = (*source)->info().frames.value_or(0);
  Progress progress("simulate", "frames", total);
  TakeOptions take;
  take.progress = [&](std::uint64_t done) {
    written = done;
    progress.update(done);
  };
  take.stop = &stopped;
  const Status done = write_take(options.out, **source, take);
  stop.clear_on_stop();
  progress.finish();
  if (stopped && !done) {  // asked for
    log_info(done.error().message);
    return {};
  }
  if (!done) return done;
  if (options.json) {
    std::puts(json_text(nlohmann::json({{"take", options.out}, {"frames", written}})).c_str());
  } else {
    std::printf("%s with truth in %s\n", counted(written, "frame").c_str(), options.out.c_str());
  }
  return {};
}

}  // namespace

Command simulate_command() {
  return {
      "simulate", "Render a take of a simulated scene, with its truth", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        app.add_option("--scene", options->scene, "SCENE[,KEY=VALUE...], see below")
            ->check([](const std::string& scene) {
              const Status possible = check_sim(scene);
              return possible ? std::string() : possible.error().message;
            })
            ->type_name("SCENE")
            ->required();
        app.add_option("--frames", options->frames, "Frames (default: one period of the scene's motion)")
            ->check(whole_number(2, 1'000'000));
        add_scheme_option(app, options->scheme);
        app.add_option("--out", options->out, "Take folder to make")->type_name("TAKE")->required();
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.footer(
            "Scenes: " + sim::scene_names() + "\n\nKeys, their values and defaults:\n" +
            sim::sim_options_help() + "\n" + scheme_help() +
            "\nExample:\n  relievo-server simulate --scene face,noise=3,stripes=120 --frames 60 --out TAKE");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
