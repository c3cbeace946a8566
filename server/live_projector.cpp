// SPDX-License-Identifier: Apache-2.0
#include "server/live_projector.h"

#include <CLI/CLI.hpp>
#include <atomic>
#include <thread>

#include "base/log.h"
#include "capture/projector/show_slides.h"
#include "capture/projector/window_display.h"

namespace relievo {

void add_live_projector_options(CLI::App& app, CLI::Option& source, ProjectorFlags& flags) {
  auto* project = app.add_flag("--project", flags.project,
                               "Project the pictures for it meanwhile, full screen, in step with the refresh")
                      ->needs(&source);
  app.add_option(
         "--projector-output", flags.projector.output,
         "With --project: the output's name, see `project --list` (default: the only, or the second one)")
      ->type_name("NAME")
      ->needs(project);
  app.add_option("--refreshes", flags.projector.refreshes,
                 "With --project: refreshes that each picture stays")
      ->check(CLI::Range(1, 4))
      ->needs(project)
      ->capture_default_str();
}

Status project_while(const std::optional<LiveProjector>& projector, Size size,
                     const std::function<Result<std::vector<Image8>>(Size)>& draw,
                     const std::function<Status()>& watch, StopSignal& stop) {
  if (!projector) return watch();
  auto display =
      open_window_display({.output = projector->output, .width = size.width, .height = size.height});
  if (!display) return display.error();
  const DisplayOutput& output = (*display)->output();
  const auto pictures = draw({output.mode.width, output.mode.height});
  if (!pictures) return pictures.error();
  log_info("projecting on " + output.name + ", " + std::to_string(output.mode.width) + "x" +
           std::to_string(output.mode.height) + "; Escape or Ctrl-C ends");

  std::atomic<bool> watched{false};
  Status watching;
  std::thread watcher([&] {
    watching = watch();
    watched = true;
  });
  const auto shown = show_cycle(
      **display, *pictures,
      {.refreshes_each = projector->refreshes, .stopped = [&] { return watched || stop.stopped(); }});
  if (!watched) stop.request();  // the window was closed, or could not be drawn: the source ends too
  watcher.join();
  if (!shown) return shown.error();
  if (shown->missed > 0) {
    log_warning(std::to_string(shown->missed) + " of " + std::to_string(shown->refreshes) + " refreshes on " +
                output.name + " were missed");
  }
  return watching;
}

}  // namespace relievo
