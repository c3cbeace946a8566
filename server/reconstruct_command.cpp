// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/time.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "capture/source/take_files.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "codec/export.h"
#include "codec/frame_names.h"
#include "server/commands.h"
#include "server/options.h"
#include "server/stats.h"
#include "server/step_watch.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTake = "take:";

struct Options {
  std::string take;
  std::string out;
  int threads = 1;
  int line_stride = 1;
  Decoder decoder = ReconstructOptions{}.decoder;
  SurfaceBuilderOptions surface;
  bool json = false;
};

struct Totals {
  Scheme scheme{};
  std::uint64_t frames = 0, white = 0, textures = 0, unreadable = 0, reconstructed = 0, same_slide = 0,
                exchanged = 0, vertices = 0, boundaries = 0, matched = 0;
  double most_excess = 0;  // of brightness of one exposure
  FilterCounts filters;
  RollingMedian detect_ms, match_ms, triangulate_ms, surface_ms, texture_ms, total_ms;
};

void count(const ReconstructReport& report, double total_ms, Totals& totals) {
  totals.boundaries += report.boundaries;
  totals.matched += report.matched;
  totals.exchanged += report.exchanged ? 1 : 0;
  totals.filters += report.filters;
  totals.most_excess = std::max(totals.most_excess, std::fabs(report.slide_excess));
  totals.detect_ms.add(report.detect_ms);
  totals.match_ms.add(report.match_ms);
  totals.triangulate_ms.add(report.triangulate_ms);
  totals.surface_ms.add(report.surface_ms);
  totals.texture_ms.add(report.texture_ms);
  totals.total_ms.add(total_ms);
}

void print(const Totals& t, const StepWatch& steps, const Options& options) {
  const double per_frame =
      t.reconstructed > 0 ? static_cast<double>(t.vertices) / static_cast<double>(t.reconstructed) : 0;
  if (options.json) {
    nlohmann::json counts;
    for (const Filter& filter : kFilters) counts[std::string(filter.name)] = t.filters.*filter.count;
    const StepStatus& s = steps.status();
    nlohmann::json step = {{"mixed", s.mixed}, {"regrouped", s.regrouped}};
    if (s.phase) step["phase"] = *s.phase;
    if (s.drift_fields_s) step["drift_fields_s"] = *s.drift_fields_s;
    const nlohmann::json out = {{"frames", t.frames},
                                {"scheme", to_string(t.scheme)},
                                {"reconstructed", t.reconstructed},
                                {"textures", t.textures},
                                {"white", t.white},
                                {"unreadable", t.unreadable},
                                {"same_slide", t.same_slide},
                                {"exchanged", t.exchanged},
                                {"step", step},
                                {"most_excess", t.most_excess},
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
    std::puts(json_text(out).c_str());
    return;
  }
  if (t.reconstructed == 0) {  // nothing is in the folder, which is gone where it was made for this
    std::printf("0 of %s reconstructed\n", counted(t.frames, "frame").c_str());
  } else if (t.scheme == Scheme::kComplementary || t.scheme == Scheme::kOneSlide) {
    std::printf("%llu of %s reconstructed into %s, %.0f vertices each, %.2f ms a frame\n",
                static_cast<unsigned long long>(t.reconstructed), counted(t.frames, "frame").c_str(),
                options.out.c_str(), per_frame, t.total_ms.median());
  } else {
    std::printf("%s: %s and %s from %s into %s, %.0f vertices each, %.2f ms a frame\n",
                std::string(to_string(t.scheme)).c_str(), counted(t.reconstructed, "surface").c_str(),
                counted(t.textures, "texture").c_str(), counted(t.frames, "frame").c_str(),
                options.out.c_str(), per_frame, t.total_ms.median());
  }
  if (t.same_slide > 0) {
    std::printf("%s showed the slide of the frame before: dropped frames in capture\n",
                counted(t.same_slide, "frame").c_str());
  }
  if (steps.status().mixed > 0) {
    std::printf("%s dropped for mixed exposures: %s\n", counted(steps.status().mixed, "frame").c_str(),
                steps.advice().c_str());
  }
  if (t.most_excess > ReconstructReport::kNotableExcess) {
    std::printf(
        "exposures up to %.1f %% brighter than the frame's other one, which was taken out: lamps that "
        "flicker?\n",
        100 * t.most_excess);
  }
  if (t.reconstructed > 0) print_filters(t.filters, t.reconstructed);
}

/// Its number is that of the take's frame that completed the surface.
std::string ply_name(std::uint64_t number, bool between) {
  return frame_name(number, between) + ".ply";
}

/// The frame that a file was written for; nothing where ply_name() gives no such name.
std::optional<std::uint64_t> number_of(const fs::path& file) {
  const std::string name = file.filename().string();
  unsigned long long number = 0;
  if (std::sscanf(name.c_str(), "%llu", &number) != 1) return std::nullopt;
  for (const bool between : {false, true})
    if (name == ply_name(number, between)) return number;
  return std::nullopt;
}

/// Of all frames that the source gives.
Result<std::set<std::uint64_t>> numbers_of(const std::string& uri, const SourceInfo& info) {
  std::set<std::uint64_t> out;
  if (!uri.starts_with(kTake)) {
    for (std::uint64_t n = 0; n < info.frames.value_or(0); ++n) out.insert(n);
    return out;
  }
  const auto stamps = read_timestamps(fs::path(uri.substr(kTake.size())) / "timestamps.csv");
  if (!stamps) return stamps.error();
  for (const TakeStamp& stamp : *stamps) out.insert(stamp.frame);
  return out;
}

/// Removes what an earlier run wrote of the same frames, some of which may give no surface now. What is of
/// others is nobody's to remove.
void remove_earlier(const fs::path& folder, const std::set<std::uint64_t>& numbers) {
  std::vector<fs::path> earlier;
  std::string other;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    const auto number = number_of(entry.path());
    if (!number) continue;
    if (numbers.contains(*number))
      earlier.push_back(entry.path());
    else
      other = entry.path().filename().string();
  }
  for (const fs::path& file : earlier) fs::remove(file, failed);  // what cannot be is told when it is written
  if (!other.empty())
    log_warning(folder.string() + " has surfaces of frames that are none of this take's (" + other +
                "): give a folder of its own to keep them apart");
}

Status run(const Options& options, StopSignal& stop) {
  // A bare folder is a take; anything else open_source knows is welcome too.
  const bool is_uri = options.take.starts_with(kTake) || options.take.starts_with("sim:");
  const std::string uri = is_uri ? options.take : std::string(kTake) + options.take;
  auto source = open_source(uri, {});
  if (!source) return source.error();
  auto reconstructor = Reconstructor::create((*source)->info().rig, (*source)->info().pattern,
                                             {.decoder = options.decoder,
                                              .threads = options.threads,
                                              .line_stride = options.line_stride,
                                              .surface = options.surface});
  if (!reconstructor) return reconstructor.error();
  if (uri.starts_with(kTake)) {
    if (const Status apart = check_apart(options.out, uri.substr(kTake.size())); !apart) return apart;
  }
  const auto folder = NewFolder::create(options.out);
  if (!folder) return folder.error();
  const auto numbers = numbers_of(uri, (*source)->info());
  if (!numbers) return numbers.error();
  remove_earlier(options.out, *numbers);

  StepWatch steps((*source)->info().pattern, (*source)->info().rig);
  Totals totals;
  totals.scheme = (*source)->info().pattern.scheme;
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
    steps.add((*next)->time_ns, reconstructor->report());
    totals.same_slide += reconstructor->report().same_slide;
    totals.white += reconstructor->report().white;
    progress.update(totals.frames);
    if (*frame) count(reconstructor->report(), ms, totals);
    for (std::optional<Frame3D> surface = *std::move(frame); surface; surface = reconstructor->next()) {
      ++totals.reconstructed;
      totals.vertices += surface->surface.positions.size();
      if (const Status written =
              write_ply(fs::path(options.out) / ply_name(surface->number, surface->between), surface->surface,
                        surface->texture.view());
          !written)
        return written.error();
      reconstructor->recycle(*std::move(surface));
    }
  }
  totals.textures = reconstructor->textures();
  if (stop.stopped()) {
    totals.frames = std::max(totals.frames, (*source)->info().frames.value_or(0));
    log_info("stopped: a part of the frames is reconstructed");
  }
  progress.finish();
  print(totals, steps, options);
  if (totals.scheme == Scheme::kWhiteFrame && totals.white == 0 && !steps.message().empty())
    log_warning(steps.message());
  if (totals.exchanged > 0) log_warning(std::to_string(totals.exchanged) + " " + steps.exchange_advice());
  if (totals.unreadable > 0) {
    return Error{std::to_string(totals.unreadable) + " of " + std::to_string(totals.frames) +
                 " frames could not be read (the last: " + last_error.message +
                 (totals.reconstructed > 0 && !stop.stopped() ? "); the others are reconstructed" : ")")};
  }
  if (totals.reconstructed == 0 && !stop.stopped()) {
    if (steps.status().mixed > 0) return Error{"no frame could be reconstructed: " + steps.advice()};
    if (totals.frames > 1 && totals.same_slide + 1 >= totals.frames) {
      return Error{
          "no frame could be reconstructed: all look as if under one slide; do the slides change, and are "
          "pictures over-exposed?"};
    }
    return Error{
        "no frame could be reconstructed: the take needs two readable frames under different slides"};
  }
  if (totals.vertices == 0 && !stop.stopped()) {
    return Error{"no surface was found in any frame, so that the files in " + options.out +
                 " are empty: are the pictures dark or over-exposed, and rig.yaml and pattern.yaml theirs?"};
  }
  return {};
}

}  // namespace

Command reconstruct_command() {
  return {
      "reconstruct", "Reconstruct a take: one PLY a frame", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        app.add_option("take", options->take, "Take folder")->type_name("TAKE")->required();
        app.add_option(
               "-o,--out", options->out,
               "Folder for NNNNNN.ply, made where it is missing; those of the same frames are replaced")
            ->type_name("DIR")
            ->check(folder_name())
            ->required();
        app.add_option("--threads", options->threads, "Threads; any number gives the same result")
            ->check(CLI::Range(1, 64))
            ->capture_default_str();
        add_decoder_option(app, options->decoder);
        add_half_lines_option(app, options->line_stride);
        add_surface_options(app, options->surface);
        app.add_flag("--json", options->json, "Print the summary as JSON");
        app.footer(
            "The take's pattern.yaml says under which scheme it was filmed: under white-frame white frames "
            "give no surface; under white-field each frame gives two, NNNNNN_between.ply half way from the "
            "frame before and NNNNNN.ply.\n");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
