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

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "capture/evaluate/frame_places.h"
#include "capture/evaluate/score.h"
#include "capture/pattern/schedule.h"
#include "capture/reconstruct/join_exposures.h"
#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"
#include "capture/source/npy.h"
#include "capture/source/take_files.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "server/commands.h"
#include "server/evaluate_pictures.h"
#include "server/options.h"
#include "server/step_watch.h"

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

Result<ImageF> read_truth(const fs::path& file, const PinholeModel& camera) {
  auto truth = read_npy(file);
  if (truth && (truth->width() != camera.width || truth->height() != camera.height))
    return Error{file.string() + " is not of the camera's size"};
  return truth;
}

/// Also where that cannot be told: reading it says why.
bool has_truth(const fs::path& file) {
  std::error_code unknown;
  return fs::exists(file, unknown) || unknown;
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

/// Of a frame. What is of another time than the frames' own truths is made, the rest lent.
class Truths {
 public:
  bool decodable = false;  // it should give a surface

  /// `before`: the truth of the frame before, empty where it is not known. A frame that was regrouped begins
  /// with the second exposure of the frame before; a progressive take has no truth of that time. Both outlive
  /// this.
  Truths(const CapturedFrame& frame, bool regrouped, const ImageF& before, const ImageF& now) : now_(&now) {
    const bool interlaced = frame.scan == Scan::kInterlaced;
    if (before.empty()) return;
    if (regrouped) {
      made_ = interlaced ? truth_of_field(before, 1) : truth_between(before, now);
      now_ = &made_;
      between_ = &before;
    } else if (interlaced) {
      made_ = truth_of_field(before, 1);
      between_ = &made_;
    }
  }
  Truths(const Truths&) = delete;
  Truths& operator=(const Truths&) = delete;

  /// At its first exposure, on the rows of geometry.
  const ImageF& now() const { return *now_; }
  /// White-field: at the second one of the frame before; null where it is not known.
  const ImageF* between() const { return between_; }

 private:
  ImageF made_;
  const ImageF* now_;
  const ImageF* between_ = nullptr;
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

/// White-field: two surfaces a frame, each against the truth of its own time.
Status judge_both(const CapturedFrame& frame, std::optional<Frame3D> completed, Reconstructor& reconstructor,
                  const Truths& truths, Judges& judges) {
  const int slide = reconstructor.report().slide;
  if (completed && completed->between) {
    if (truths.between() != nullptr) {
      if (auto s = judges.judge(frame, slide, *truths.between(), &*completed); !s) return s;
    }
    completed = reconstructor.next();
  }
  if (!completed && !truths.decodable) return {};
  return judges.judge(frame, slide, truths.now(), completed ? &*completed : nullptr);
}

/// The exposures that a frame was decoded by, as the camera gave them.
class AsDecoded {
 public:
  const CapturedFrame& of(const CapturedFrame& frame, bool regrouped) {
    if (regrouped) join_exposures(before_, frame, joined_);
    joined_.number = frame.number;
    return regrouped ? joined_ : frame;
  }
  /// Takes what the next one may need.
  void keep(CapturedFrame&& frame) {
    before_ = std::move(frame.scan == Scan::kInterlaced ? frame.picture : frame.complement);
  }

 private:
  Image8 before_;
  CapturedFrame joined_;
};

/// How the time stamps of a take tell what was projected, independently of the decoder, so that what that
/// takes for something else counts as missing.
struct Timing {
  double period_ns;
  std::uint64_t lead = 0;  // frames by which the projector was ahead of the take's first one
};

/// Whether two frames that follow each other fit what the decoder takes the later one for.
bool fits(const Pattern& pattern, const ReconstructReport& report, std::uint64_t before, std::uint64_t now) {
  const Exposure exposure = shown(pattern, now, 0);
  if (pattern.scheme == Scheme::kWhiteFrame) return (exposure.light == Light::kWhite) == report.white;
  return (exposure.slide == shown(pattern, before, 0).slide) == report.same_slide;
}

/// Where stamps and scheme leave a choice, that which the most of the first frames fit. The lead is 0 but
/// under white-frame: which of two slides came first changes no score.
Result<Timing> find_timing(const Options& options, const SourceInfo& info) {
  constexpr int kFrames = 30;  // ten times the three of white-frame
  const auto stamps = read_timestamps(fs::path(options.take) / "timestamps.csv");
  if (!stamps) return stamps.error();
  const Pattern& pattern = info.pattern;
  const int leads = pattern.scheme == Scheme::kWhiteFrame ? cycle_frames(pattern) : 1;
  std::vector<Timing> choices;
  std::vector<FramePlaces> places;
  for (const double period_ns : likely_periods_ns(*stamps, info.rig.frame_rate)) {
    for (int lead = 0; lead < leads; ++lead) {
      choices.push_back({period_ns, static_cast<std::uint64_t>(lead)});
      places.emplace_back(period_ns);
    }
  }
  if (choices.size() == 1 || cycle_frames(pattern) == 1) return choices.front();
  auto source = open_source("take:" + options.take, {});
  if (!source) return source.error();
  auto reconstructor = Reconstructor::create(info.rig, pattern, {.decoder = Decoder::kQuick});
  if (!reconstructor) return reconstructor.error();
  std::vector<std::uint64_t> before(choices.size());
  std::vector<int> fitting(choices.size());
  for (int i = 0; i < kFrames; ++i) {
    auto next = (*source)->next();
    if (!next) return next.error();
    if (!*next) break;
    if (const Status seen = reconstructor->observe(**next); !seen) return seen.error();
    for (std::size_t c = 0; c < choices.size(); ++c) {
      const std::uint64_t now = places[c].next((*next)->time_ns) + choices[c].lead;
      fitting[c] += fits(pattern, reconstructor->report(), before[c], now) ? 1 : 0;
      before[c] = now;
    }
  }
  return choices[static_cast<std::size_t>(std::ranges::max_element(fitting) - fitting.begin())];
}

/// Scores the frames of a take, one after the other.
class Evaluation {
 public:
  Evaluation(const Options& options, const SourceInfo& info, Reconstructor& reconstructor, Judges& judges)
      : options_(options),
        info_(info),
        reconstructor_(reconstructor),
        judges_(judges),
        steps_(info.pattern, info.rig) {}

  /// Of the frames scored.
  const FilterCounts& filters() const { return filters_; }
  std::uint64_t done() const { return done_; }
  const StepWatch& steps() const { return steps_; }

  Status add(CapturedFrame&& frame, const Exposure& exposure) {
    bool decodable = exposure.light == Light::kSlide &&
                     (info_.pattern.slides == 1 || (previous_slide_ && *previous_slide_ != exposure.slide));
    if (exposure.light == Light::kSlide) previous_slide_ = exposure.slide;
    auto result = reconstructor_.add(frame);
    if (!result) return result.error();
    ++done_;
    steps_.add(frame.time_ns, reconstructor_.report());
    const bool regrouped = reconstructor_.report().step.regrouped;
    // The first two frames are one pair then.
    decodable = decodable && !(regrouped && done_ == 2 && info_.pattern.slides > 1);
    const CapturedFrame& shown = as_decoded_.of(frame, regrouped);
    if (auto s = score(frame, shown, decodable, std::move(*result)); !s) return s;
    as_decoded_.keep(std::move(frame));
    return {};
  }

 private:
  Status score(const CapturedFrame& frame, const CapturedFrame& shown, bool decodable,
               std::optional<Frame3D> completed) {
    const fs::path file = take_truth(options_.take, frame.number);
    if (done_ <= options_.skip || !has_truth(file)) {
      previous_truth_ = ImageF();
      return {};
    }
    auto truth = read_truth(file, info_.rig.camera);
    if (!truth) return truth.error();
    const bool regrouped = reconstructor_.report().step.regrouped;
    if (regrouped && previous_truth_.empty() && has_truth(take_truth(options_.take, frame.number - 1))) {
      auto before = read_truth(take_truth(options_.take, frame.number - 1), info_.rig.camera);
      if (!before) return before.error();
      previous_truth_ = *std::move(before);
    }
    const bool white_field = info_.pattern.scheme == Scheme::kWhiteField;
    const ImageF none;  // other schemes need the frame before where the exposures are of two frames
    Truths truths(frame, regrouped, white_field || regrouped ? previous_truth_ : none, *truth);
    truths.decodable = decodable;
    filters_ += reconstructor_.report().filters;
    Status judged;
    if (white_field) {
      judged = judge_both(shown, std::move(completed), reconstructor_, truths, judges_);
    } else if (decodable) {
      judged = judges_.judge(shown, reconstructor_.report().slide, truths.now(),
                             completed ? &*completed : nullptr);
    }
    previous_truth_ = *std::move(truth);
    return judged;
  }

  const Options& options_;
  const SourceInfo& info_;
  Reconstructor& reconstructor_;
  Judges& judges_;
  FilterCounts filters_;
  std::optional<int> previous_slide_;
  ImageF previous_truth_;
  AsDecoded as_decoded_;
  StepWatch steps_;
  std::uint64_t done_ = 0;
};

/// Until the take ends, something fails or the command is stopped.
Status score_frames(FieldSource& source, const Timing& timing, Evaluation& evaluation, StopSignal& stop) {
  FramePlaces places(timing.period_ns);
  Progress progress("evaluate", "frames", source.info().frames.value_or(0));
  while (!stop.stopped()) {
    auto next = source.next();
    if (!next) return next.error();
    if (!*next) break;
    const std::uint64_t place = places.next((*next)->time_ns) + timing.lead;
    const Exposure exposure = shown(source.info().pattern, place, 0);
    if (auto s = evaluation.add(*std::move(*next), exposure); !s) return s;
    progress.update(evaluation.done());
  }
  progress.finish();
  return {};
}

/// Of another size than rig.yaml says, say; for that size what takes seconds would be computed first.
Status check_first_frame(const std::string& take) {
  auto source = open_source("take:" + take, {});
  if (!source) return source.error();
  const auto first = (*source)->next();
  return first ? Status() : first.error();
}

Status run(const Options& options, StopSignal& stop) {
  auto source = open_source("take:" + options.take, {});
  if (!source) return source.error();
  const SourceInfo& info = (*source)->info();
  std::error_code ignored;
  if (!fs::is_directory(fs::path(options.take) / "truth", ignored)) {
    return Error{options.take +
                 " has no truth/ folder to score against; relievo-server simulate writes takes with truth"};
  }
  if (const Status readable = check_first_frame(options.take); !readable) return readable;
  auto reconstructor = Reconstructor::create(info.rig, info.pattern,
                                             {.decoder = options.decoder,
                                              .threads = options.threads,
                                              .texture = !options.pictures.empty(),
                                              .surface = options.surface});
  if (!reconstructor) return reconstructor.error();

  const auto timing = find_timing(options, info);
  if (!timing) return timing.error();

  Judges judges{Scorer(reconstructor->rig(), reconstructor->pattern())};
  if (!options.pictures.empty()) {
    if (const Status apart = check_apart(options.pictures, options.take); !apart) return apart;
    auto made = EvaluationPictures::create(options.pictures, reconstructor->rig(), reconstructor->pattern());
    if (!made) return made.error();
    judges.pictures.emplace(*std::move(made));
  }

  Evaluation evaluation(options, info, *reconstructor, judges);
  const Status scored = score_frames(**source, *timing, evaluation, stop);
  const Score score = judges.scorer.score();
  if (!scored || stop.stopped()) {
    if (scored) log_info("stopped: there is no score, which would be of a part");
    // The pictures that there are want their page all the same.
    if (!judges.pictures || score.frames == 0) return scored;
    const Status shown = judges.pictures->finish(
        options.take + ": its first " + counted(evaluation.done(), "frame") + ", broken off", score,
        evaluation.filters());
    return scored ? shown : scored;
  }
  if (score.of == 0 && options.skip >= evaluation.done())
    return Error{"no frame of " + options.take + " could be scored: --skip " + std::to_string(options.skip) +
                 " leaves out all " + std::to_string(evaluation.done())};
  if (score.frames == 0)
    return Error{"no frame of " + options.take + " could be scored: none with truth was reconstructed"};
  if (judges.pictures) {
    const Status written = judges.pictures->finish(options.take, score, evaluation.filters());
    if (!written) return written.error();
  }
  print(score, evaluation.filters(), options.json);
  if (const StepWatch& steps = evaluation.steps(); steps.exchanged() > 0)
    log_warning(steps.exchange_advice());
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
                ->check(folder_name())
                ->type_name("DIR");
            app.add_flag("--json", options->json, "Print the score as JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
