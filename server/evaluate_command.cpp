// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/log.h"
#include "base/time.h"
#include "capture/evaluate/score.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "capture/source/npy.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "server/commands.h"
#include "server/evaluate_pictures.h"
#include "server/options.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string take;
  std::uint64_t skip = 1;
  int threads = 1;
  Decoder decoder = ReconstructOptions{}.decoder;
  SurfaceBuilderOptions surface;
  std::string pictures;
  bool json = false;
};

fs::path truth_of(const fs::path& take, std::uint64_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "%06llu.npy", static_cast<unsigned long long>(number));
  return take / "truth" / name;
}

void print(const Score& s, const FilterCounts& filters, bool json) {
  if (json) {
    nlohmann::json counts;
    for (const Filter& filter : kFilters) counts[std::string(filter.name)] = filters.*filter.count;
    const nlohmann::json out = {{"frames", s.frames},
                                {"of", s.of},
                                {"vertices_per_frame", s.vertices_per_frame},
                                {"completeness", s.completeness},
                                {"outliers", s.outliers},
                                {"median_um_per_m", s.median_um_per_m},
                                {"rms_um_per_m", s.rms_um_per_m},
                                {"p95_um_per_m", s.p95_um_per_m},
                                {"filters", counts}};
    std::printf("%s\n", out.dump(2).c_str());
    return;
  }
  std::printf("frames        %zu of %zu\n", s.frames, s.of);
  std::printf("vertices      %.0f a frame\n", s.vertices_per_frame);
  std::printf("completeness  %.4f of the visible boundaries\n", s.completeness);
  std::printf("outliers      %.3f %%\n", 100 * s.outliers);
  std::printf("depth error   median %.1f, RMS %.1f, 95 %% under %.1f um a metre\n", s.median_um_per_m,
              s.rms_um_per_m, s.p95_um_per_m);
  print_filters(filters, s.frames);
}

Status run(const Options& options, StopSignal& stop) {
  auto source = open_source("take:" + options.take, {});
  if (!source) return source.error();
  const SourceInfo& info = (*source)->info();
  if (!fs::is_directory(fs::path(options.take) / "truth")) {
    return Error{options.take +
                 " has no truth/ folder to score against; relievo-server simulate writes takes with truth"};
  }
  auto reconstructor = Reconstructor::create(info.rig, info.pattern,
                                             {.decoder = options.decoder,
                                              .threads = options.threads,
                                              .texture = !options.pictures.empty(),
                                              .surface = options.surface});
  if (!reconstructor) return reconstructor.error();

  std::optional<EvaluationPictures> pictures;
  if (!options.pictures.empty()) {
    auto made = EvaluationPictures::create(options.pictures, info.rig, info.pattern);
    if (!made) return made.error();
    pictures = *std::move(made);
  }

  Scorer scorer(info.rig, info.pattern);
  Progress progress("evaluate", "frames", info.frames.value_or(0));
  FilterCounts filters;  // of the frames scored
  std::optional<long> previous_slide;
  std::uint64_t done = 0;
  while (!stop.stopped()) {
    auto next = (*source)->next();
    if (!next) return next.error();  // a score over part of a take would not be comparable
    if (!*next) break;
    const CapturedFrame& frame = **next;
    // Slides alternate with time: which one this is follows from the time stamp, independently of the
    // decoder.
    const long slide = std::lround(seconds(frame.time_ns) * info.rig.frame_rate) % info.pattern.slides;
    const bool decodable = info.pattern.slides == 1 || (previous_slide && *previous_slide != slide);
    previous_slide = slide;
    auto result = reconstructor->add(frame);
    if (!result) return result.error();
    progress.update(++done);
    const fs::path file = truth_of(options.take, frame.number);
    if (frame.number < options.skip || !decodable || !fs::exists(file)) continue;
    auto truth = read_npy(file);
    if (!truth) return truth.error();
    if (truth->width() != info.rig.camera.width || truth->height() != info.rig.camera.height) {
      return Error{file.string() + " is not of the camera's size"};
    }
    Judgement judgement;
    scorer.add(*truth, *result ? &(*result)->surface : nullptr, pictures ? &judgement : nullptr);
    if (pictures && *result) {
      const Status drawn = pictures->add(frame, static_cast<int>(slide), **result, judgement);
      if (!drawn) return drawn.error();
    }
    filters += reconstructor->report().filters;
  }
  progress.finish();
  if (stop.stopped()) return {};  // nor would what was scored until now
  const Score score = scorer.score();
  if (score.frames == 0)
    return Error{"no frame of " + options.take + " could be scored: none with truth was reconstructed"};
  if (pictures) {
    const Status written = pictures->finish(options.take, score, filters);
    if (!written) return written.error();
  }
  print(score, filters, options.json);
  return {};
}

}  // namespace

Command evaluate_command() {
  return {"evaluate", "Reconstruct a take and score it against its truth", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            app.add_option("take", options->take, "Take folder with truth/")->type_name("TAKE")->required();
            app.add_option("--skip", options->skip, "Frames at the start that are not scored")
                ->check(whole_number(0))
                ->capture_default_str();
            app.add_option("--threads", options->threads, "Threads; any number gives the same result")
                ->check(CLI::Range(1, 64))
                ->capture_default_str();
            add_decoder_option(app, options->decoder);
            add_surface_options(app, options->surface);
            app.add_option(
                   "--pictures", options->pictures,
                   "Write error maps and pictures of every stage into this folder; open its index.html")
                ->type_name("DIR");
            app.add_flag("--json", options->json, "Print the score as JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
