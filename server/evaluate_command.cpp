// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "capture/evaluate/score.h"
#include "capture/pattern/schedule.h"
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
    std::puts(json_text(out).c_str());
    return;
  }
  std::printf("frames        %zu of %zu\n", s.frames, s.of);
  std::printf("vertices      %.0f a frame\n", s.vertices_per_frame);
  std::printf("completeness  %.4f of the visible boundaries\n", s.completeness);
  std::printf("outliers      %.3f %%\n", 100 * s.outliers);
  if (std::isnan(s.median_um_per_m))
    std::puts("depth error   not known: no vertex is right");
  else
    std::printf("depth error   median %.1f, RMS %.1f, 95 %% under %.1f um a metre\n", s.median_um_per_m,
                s.rms_um_per_m, s.p95_um_per_m);
  print_filters(filters, s.frames);
}

/// Of a frame.
struct Truths {
  bool decodable;        // it should give a surface
  const ImageF& before;  // the frame's before, empty where it is not known
  const ImageF& now;
};

/// What is scored and drawn.
struct Judges {
  Scorer scorer;
  std::optional<EvaluationPictures> pictures = {};

  /// `result` is null where the frame should have given a surface and did not.
  Status judge(const CapturedFrame& frame, int slide, const ImageF& truth, const Frame3D* result) {
    Judgement judgement;
    scorer.add(truth, result ? &result->surface : nullptr, pictures ? &judgement : nullptr);
    if (!pictures || result == nullptr || result->between) return {};
    return pictures->add(frame, slide, *result, judgement);
  }
};

/// White-field: two surfaces a frame, each against the truth of its own field. A progressive take has none of
/// the times of its second pictures.
Status judge_both(const CapturedFrame& frame, std::optional<Frame3D> completed, Reconstructor& reconstructor,
                  const Truths& truths, Judges& judges) {
  const int slide = reconstructor.report().slide;
  const bool interlaced = frame.scan == Scan::kInterlaced;
  const auto at = [&](const ImageF& truth, int half) {
    return interlaced ? truth_of_field(truth, half) : truth.clone();
  };
  if (completed && completed->between) {
    if (interlaced && !truths.before.empty()) {
      if (auto s = judges.judge(frame, slide, at(truths.before, 1), &*completed); !s) return s;
    }
    completed = reconstructor.next();
  }
  if (!completed && !truths.decodable) return {};
  return judges.judge(frame, slide, at(truths.now, 0), completed ? &*completed : nullptr);
}

/// What was projected follows from the time stamp, independently of the decoder, so that what that takes for
/// something else counts as missing. `lead`: frames by which the projector was ahead of the take's first one.
Exposure shown_in(const CapturedFrame& frame, const SourceInfo& info, std::uint64_t lead) {
  const long place = std::max(0L, std::lround(seconds(frame.time_ns) * info.rig.frame_rate));
  return shown(info.pattern, static_cast<std::uint64_t>(place) + lead, 0);
}

/// The lead under which the most of the first frames are white that look white. 0 under other schemes: which
/// of two slides came first changes no score.
Result<std::uint64_t> find_lead(const Options& options, const SourceInfo& info) {
  constexpr int kFrames = 30;  // ten times the three of white-frame
  if (info.pattern.scheme != Scheme::kWhiteFrame) return std::uint64_t{0};
  auto source = open_source("take:" + options.take, {});
  if (!source) return source.error();
  auto reconstructor = Reconstructor::create(info.rig, info.pattern, {.decoder = Decoder::kQuick});
  if (!reconstructor) return reconstructor.error();
  std::vector<int> fitting(static_cast<std::size_t>(cycle_frames(info.pattern)));
  for (int i = 0; i < kFrames; ++i) {
    auto next = (*source)->next();
    if (!next) return next.error();
    if (!*next) break;
    if (const Status seen = reconstructor->observe(**next); !seen) return seen.error();
    for (std::size_t lead = 0; lead < fitting.size(); ++lead)
      fitting[lead] +=
          (shown_in(**next, info, lead).light == Light::kWhite) == reconstructor->report().white ? 1 : 0;
  }
  return static_cast<std::uint64_t>(std::ranges::max_element(fitting) - fitting.begin());
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

  const auto lead = find_lead(options, info);
  if (!lead) return lead.error();

  Judges judges{Scorer(reconstructor->rig(), reconstructor->pattern())};
  if (!options.pictures.empty()) {
    auto made = EvaluationPictures::create(options.pictures, reconstructor->rig(), reconstructor->pattern());
    if (!made) return made.error();
    judges.pictures = *std::move(made);
  }

  Progress progress("evaluate", "frames", info.frames.value_or(0));
  FilterCounts filters;  // of the frames scored
  std::optional<int> previous_slide;
  ImageF previous_truth;
  std::uint64_t done = 0;
  while (!stop.stopped()) {
    auto next = (*source)->next();
    if (!next) return next.error();  // a score over part of a take would not be comparable
    if (!*next) break;
    const CapturedFrame& frame = **next;
    const Exposure exposure = shown_in(frame, info, *lead);
    const bool decodable =
        exposure.light == Light::kSlide &&
        (info.pattern.slides == 1 || (previous_slide && *previous_slide != exposure.slide));
    if (exposure.light == Light::kSlide) previous_slide = exposure.slide;
    auto result = reconstructor->add(frame);
    if (!result) return result.error();
    progress.update(++done);
    const fs::path file = truth_of(options.take, frame.number);
    if (frame.number < options.skip || !fs::exists(file)) {
      previous_truth = ImageF();
      continue;
    }
    auto truth = read_npy(file);
    if (!truth) return truth.error();
    if (truth->width() != info.rig.camera.width || truth->height() != info.rig.camera.height) {
      return Error{file.string() + " is not of the camera's size"};
    }
    filters += reconstructor->report().filters;
    Status judged;
    if (info.pattern.scheme == Scheme::kWhiteField) {
      judged =
          judge_both(frame, std::move(*result), *reconstructor, {decodable, previous_truth, *truth}, judges);
    } else if (decodable) {
      judged = judges.judge(frame, reconstructor->report().slide, *truth, *result ? &**result : nullptr);
    }
    if (!judged) return judged.error();
    previous_truth = *std::move(truth);
  }
  progress.finish();
  if (stop.stopped()) return {};  // nor would what was scored until now
  const Score score = judges.scorer.score();
  if (score.frames == 0)
    return Error{"no frame of " + options.take + " could be scored: none with truth was reconstructed"};
  if (judges.pictures) {
    const Status written = judges.pictures->finish(options.take, score, filters);
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
