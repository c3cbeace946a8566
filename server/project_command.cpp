// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "capture/calibrate/sheet_colours.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"
#include "capture/projector/show_slides.h"
#include "capture/projector/window_display.h"
#include "capture/rig_file.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/size_option.h"
#include "server/commands.h"
#include "server/options.h"
#include "server/pattern_options.h"

namespace relievo {
namespace {

struct Options {
  bool list = false;
  std::string output;
  std::string rig;
  Size size;  // 0: the output's mode
  double refresh_hz = 0;
  PatternOptions pattern;
  bool interlaced = false;
  std::string field_order = "top";
  int refreshes = 1;
  std::optional<std::uint64_t> pictures;
  std::string still, cycle;
  bool json = false;
};

Status list(const Options& options) {
  const auto outputs = window_outputs();
  if (!outputs) return outputs.error();
  nlohmann::json all = nlohmann::json::array();
  const auto json_of = [](const DisplayMode& mode) {
    return nlohmann::json{{"width", mode.width}, {"height", mode.height}, {"refresh_hz", mode.refresh_hz}};
  };
  for (const DisplayOutput& output : *outputs) {
    nlohmann::json modes = nlohmann::json::array();
    for (const DisplayMode& mode : output.modes) modes.push_back(json_of(mode));
    all.push_back({{"output", output.name},
                   {"primary", output.primary},
                   {"mode", json_of(output.mode)},
                   {"modes", modes}});
    if (options.json) continue;
    std::printf("%s: %dx%d at %.0f Hz%s\n", output.name.c_str(), output.mode.width, output.mode.height,
                output.mode.refresh_hz, output.primary ? ", primary" : "");
    for (const DisplayMode& mode : output.modes)
      std::printf("  %dx%d at %.0f Hz\n", mode.width, mode.height, mode.refresh_hz);
  }
  if (options.json) std::puts(json_text(all).c_str());
  return {};
}

/// A picture that --still can show. The names of slides are those that `pattern` gives its files.
struct Still {
  std::optional<int> slide;  // none: one colour
  bool complement = false;   // or black, not white
};

Result<Still> still_named(const std::string& name, const Pattern& pattern) {
  if (name == "white" || name == "black") return Still{std::nullopt, name == "black"};
  for (int slide = 0; slide < pattern.slides; ++slide) {
    for (const bool complement : {false, true}) {
      if (name == "slide" + std::to_string(slide + 1) + (complement ? "_complement" : ""))
        return Still{slide, complement};
    }
  }
  return Error{"there is no picture " + name + ": give white, black, slide1, ..."};
}

Image8 draw(const Still& still, const Pattern& pattern, const DisplayMode& mode) {
  if (still.slide) return draw_slide(pattern, *still.slide, still.complement, mode.width, mode.height);
  Image8 out(mode.width, mode.height, 3);
  std::fill_n(out.data(), out.size(), static_cast<std::uint8_t>(still.complement ? 0 : 255));
  return out;
}

/// Wrong usage, as far as it shows before files are read and a window opens.
void check(const Options& options) {
  check_pattern_options(options.pattern);
  if (options.still.empty() || !options.pattern.file.empty()) return;
  if (const auto still = still_named(options.still, *pattern_of(options.pattern)); !still)
    throw CLI::ValidationError("--still", still.error().message);
}

/// What a calibration needs; empty for the pattern's own slides.
Result<std::vector<Image8>> cycle_of(const std::string& name, const Pattern& pattern,
                                     const DisplayMode& mode) {
  if (name == "colours") return draw_sheet_colours(mode.width, mode.height);
  if (name == "stripes") return draw_stripe_slides(pattern, mode.width, mode.height, Scan::kProgressive);
  return std::vector<Image8>();
}

Status report(const ShowReport& shown, const Options& options, const DisplayOutput& output) {
  if (options.json) {
    const nlohmann::json json = {{"output", output.name},
                                 {"width", output.mode.width},
                                 {"height", output.mode.height},
                                 {"pictures", shown.pictures},
                                 {"refreshes", shown.refreshes},
                                 {"missed", shown.missed},
                                 {"refresh_hz", shown.refresh_hz},
                                 {"synchronised", shown.synchronised},
                                 {"counted_by_display", shown.counted}};
    std::puts(json_text(json).c_str());
  } else {
    std::printf("%s in %llu refreshes of %.2f Hz on %s, %llu missed\n",
                counted(shown.pictures, "picture").c_str(), static_cast<unsigned long long>(shown.refreshes),
                shown.refresh_hz, output.name.c_str(), static_cast<unsigned long long>(shown.missed));
  }
  return {};
}

Status report_still(const Options& options, const DisplayOutput& output) {
  const DisplayMode& mode = output.mode;
  if (options.json) {
    const nlohmann::json json = {
        {"output", output.name}, {"width", mode.width}, {"height", mode.height}, {"still", options.still}};
    std::puts(json_text(json).c_str());
  } else {
    std::printf("%s on %s, %dx%d\n", options.still.c_str(), output.name.c_str(), mode.width, mode.height);
  }
  return {};
}

Status project(const Options& options, StopSignal& stop) {
  auto pattern = pattern_of(options.pattern);
  if (!pattern) return pattern.error();
  std::optional<Still> still;
  if (!options.still.empty()) {
    auto named = still_named(options.still, *pattern);
    if (!named) return named.error();
    still = *named;
  }
  DisplayChoice choice{options.output, options.size.width, options.size.height, options.refresh_hz};
  ShowOptions show;
  show.interlaced = options.interlaced;
  show.field_order = field_order_named(options.field_order);
  if (!options.rig.empty()) {
    const auto rig = read_rig(options.rig);
    if (!rig) return rig.error();
    // Stripes must lie where the calibration believes them: its mode, and no other.
    choice.width = rig->projector.width;
    choice.height = rig->projector.height;
    show.field_order = rig->field_order;
  }
  auto display = open_window_display(choice);
  if (!display) return display.error();
  const DisplayOutput output = (*display)->output();
  if (const Status fits = fits_projector(*pattern, output.mode.width); !fits) return fits;
  log_info("projecting on " + output.name + ", " + std::to_string(output.mode.width) + "x" +
           std::to_string(output.mode.height) + "; Escape or Ctrl-C ends");
  const auto stopped = [&stop] { return stop.stopped(); };
  if (still) {
    const Status shown = show_still(**display, draw(*still, *pattern, output.mode), stopped);
    if (!shown) return shown;
    display->reset();
    return report_still(options, output);
  }
  const auto cycle = cycle_of(options.cycle, *pattern, output.mode);
  if (!cycle) return cycle.error();
  Progress progress("project", "pictures", options.pictures.value_or(0));
  bool warned = false;
  show.refreshes_each = options.refreshes;
  show.pictures = options.pictures;
  show.stopped = stopped;
  show.progress = [&](const ShowReport& shown) {
    progress.update(shown.pictures, std::to_string(shown.missed) + " missed");
    if (shown.synchronised || std::exchange(warned, true)) return;
    log_warning(output.name +
                " does not wait for its refresh: slides are paced by the clock and may tear; switch vertical "
                "sync on in the graphics driver and the compositor off");
  };
  const auto shown =
      cycle->empty() ? show_slides(**display, *pattern, show) : show_cycle(**display, *cycle, show);
  progress.finish();
  if (!shown) return shown.error();
  display->reset();  // the desktop is back before anything is said
  return report(*shown, options, output);
}

}  // namespace

Command project_command() {
  return {
      "project", "Project a pattern's slides full screen, in step with the display's refresh",
      [](CLI::App& app) {
        auto o = std::make_shared<Options>();
        app.add_flag("--list", o->list, "List the outputs and their modes, and end");
        app.add_option("--output", o->output, "The projector's output (default: the only, or the second one)")
            ->type_name("NAME");
        auto* size = add_size_option(app, "--size", o->size, "Its mode, WIDTHxHEIGHT (default: as it is)");
        app.add_option("--rig", o->rig, "A calibrated rig.yaml: its projector's mode and field order")
            ->type_name("FILE")
            ->excludes(size);
        app.add_option("--refresh", o->refresh_hz, "The mode's refreshes a second (default: as it is)")
            ->check(number(1, 1000))
            ->type_name("HZ");
        add_pattern_options(app, o->pattern);
        app.add_option("--refreshes", o->refreshes, "Refreshes that each picture stays")
            ->check(CLI::Range(1, 4))
            ->capture_default_str();
        auto* interlaced = app.add_flag("--interlaced", o->interlaced,
                                        "A frame's two fields in one picture, for an interlaced output");
        app.add_option("--field-order", o->field_order, "With --interlaced: the field that comes first")
            ->check(CLI::IsMember({"top", "bottom"}))
            ->capture_default_str()
            ->needs(interlaced);
        auto* pictures = app.add_option("--pictures", o->pictures, "End after so many (default: never)")
                             ->check(whole_number(1));
        auto* cycle =
            app.add_option("--cycle", o->cycle,
                           "Show what a calibration needs in turn: colours (black, red, green and blue, each "
                           "before its complement) or stripes (along columns and along rows)")
                ->check(CLI::IsMember({"colours", "stripes"}))
                ->type_name("NAME");
        app.add_option("--still", o->still,
                       "Show one picture all the time, to aim and focus: white, black, slide1, "
                       "slide1_complement, ...")
            ->type_name("NAME")
            ->excludes(pictures)
            ->excludes(cycle);
        app.add_flag("--json", o->json, "Print the report as JSON");
        app.final_callback([o] { check(*o); });
        app.footer(
            "Examples:\n"
            "  relievo-server project --list\n"
            "  relievo-server project --output HDMI-1 --still white\n"
            "  relievo-server project --output HDMI-1 --rig rig.yaml --pattern pattern.yaml\n\n" +
            std::string(scheme_help()));
        return [o](StopSignal& stop) { return o->list ? list(*o) : project(*o, stop); };
      }};
}

}  // namespace relievo
