// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "base/time.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "cli/progress.h"
#include "codec/export.h"
#include "server/commands.h"
#include "server/options.h"
#include "server/stats.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string take;
  std::string out;
  int threads = 1;
  Decoder decoder = ReconstructOptions{}.decoder;
  SurfaceBuilderOptions surface;
  bool json = false;
};

struct Totals {
  std::uint64_t frames = 0, unreadable = 0, reconstructed = 0, same_slide = 0, vertices = 0, boundaries = 0,
                matched = 0;
  FilterCounts filters;
  RollingMedian detect_ms, match_ms, triangulate_ms, surface_ms, texture_ms, total_ms;
};

void count(const ReconstructReport& report, double total_ms, Totals& totals) {
  totals.boundaries += report.boundaries;
  totals.matched += report.matched;
  totals.filters += report.filters;
  totals.detect_ms.add(report.detect_ms);
  totals.match_ms.add(report.match_ms);
  totals.triangulate_ms.add(report.triangulate_ms);
  totals.surface_ms.add(report.surface_ms);
  totals.texture_ms.add(report.texture_ms);
  totals.total_ms.add(total_ms);
}

void print(const Totals& t, const Options& options) {
  const double per_frame =
      t.reconstructed > 0 ? static_cast<double>(t.vertices) / static_cast<double>(t.reconstructed) : 0;
  if (options.json) {
    nlohmann::json counts;
    for (const Filter& filter : kFilters) counts[std::string(filter.name)] = t.filters.*filter.count;
    const nlohmann::json out = {{"frames", t.frames},
                                {"reconstructed", t.reconstructed},
                                {"unreadable", t.unreadable},
                                {"same_slide", t.same_slide},
                                {"vertices_per_frame", per_frame},
                                {"boundaries", t.boundaries},
                                {"decoded", t.matched},
                                {"filters", counts},
                                {"median_ms",
                                 {{"detect", t.detect_ms.median()},
                                  {"match", t.match_ms.median()},
                                  {"triangulate", t.triangulate_ms.median()},
                                  {"surface", t.surface_ms.median()},
                                  {"texture", t.texture_ms.median()},
                                  {"total", t.total_ms.median()}}}};
    std::printf("%s\n", out.dump(2).c_str());
    return;
  }
  std::printf("%llu of %llu frames reconstructed into %s, %.0f vertices each, %.2f ms a frame\n",
              static_cast<unsigned long long>(t.reconstructed), static_cast<unsigned long long>(t.frames),
              options.out.c_str(), per_frame, t.total_ms.median());
  if (t.same_slide > 0) {
    std::printf("%llu frames showed the slide of the frame before: dropped frames in capture\n",
                static_cast<unsigned long long>(t.same_slide));
  }
  if (t.reconstructed > 0) print_filters(t.filters, t.reconstructed);
}

Status run(const Options& options, StopSignal& stop) {
  // A bare folder is a take; anything else open_source knows is welcome too.
  const bool is_uri = options.take.starts_with("take:") || options.take.starts_with("sim:");
  auto source = open_source(is_uri ? options.take : "take:" + options.take, {});
  if (!source) return source.error();
  auto reconstructor = Reconstructor::create(
      (*source)->info().rig, (*source)->info().pattern,
      {.decoder = options.decoder, .threads = options.threads, .surface = options.surface});
  if (!reconstructor) return reconstructor.error();
  std::error_code failed;
  const bool made = fs::create_directories(options.out, failed);
  if (failed) return Error{"cannot make the folder " + options.out + ": " + failed.message()};

  Totals totals;
  Error last_error;
  Progress progress("reconstruct", "frames", (*source)->info().frames.value_or(0));
  while (!stop.stopped()) {
    auto next = (*source)->next();
    if (!next) {
      last_error = next.error();
      log_warning(last_error.message);
      ++totals.frames;
      ++totals.unreadable;
      continue;
    }
    if (!*next) break;
    ++totals.frames;
    const std::int64_t begin = steady_now_ns();
    auto frame = reconstructor->add(**next);
    if (!frame) return frame.error();
    const double ms = milliseconds(steady_now_ns() - begin);
    totals.same_slide += reconstructor->report().same_slide;
    progress.update(totals.frames);
    if (!*frame) continue;
    count(reconstructor->report(), ms, totals);
    ++totals.reconstructed;
    totals.vertices += (*frame)->surface.positions.size();
    char name[32];
    std::snprintf(name, sizeof name, "%06llu.ply", static_cast<unsigned long long>((*frame)->number));
    if (const Status written =
            write_ply(fs::path(options.out) / name, (*frame)->surface, (*frame)->texture.view());
        !written)
      return written.error();
    reconstructor->recycle(*std::move(*frame));
  }
  progress.finish();
  if (made && totals.reconstructed == 0) fs::remove(options.out, failed);
  print(totals, options);
  if (totals.unreadable > 0) {
    return Error{std::to_string(totals.unreadable) + " of " + std::to_string(totals.frames) +
                 " frames could not be read (the last: " + last_error.message +
                 "); the others are reconstructed"};
  }
  if (totals.reconstructed == 0 && !stop.stopped()) {
    return Error{
        "no frame could be reconstructed: the take needs two readable frames under different slides"};
  }
  return {};
}

}  // namespace

Command reconstruct_command() {
  return {"reconstruct", "Reconstruct a take: one PLY a frame", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("take", options->take, "Take folder")->type_name("TAKE")->required();
            app.add_option("-o,--out", options->out, "Folder for NNNNNN.ply, made where it is missing")
                ->type_name("DIR")
                ->required();
            app.add_option("--threads", options->threads, "Threads; any number gives the same result")
                ->check(CLI::Range(1, 64))
                ->capture_default_str();
            add_decoder_option(app, options->decoder);
            add_surface_options(app, options->surface);
            app.add_flag("--json", options->json, "Print the summary as JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
