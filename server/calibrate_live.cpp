// SPDX-License-Identifier: Apache-2.0
#include "server/calibrate_live.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "base/counted.h"
#include "base/log.h"
#include "base/new_folder.h"
#include "base/whole_file.h"
#include "capture/calibrate/colour.h"
#include "capture/calibrate/coverage.h"
#include "capture/calibrate/measure_view.h"
#include "capture/calibrate/pictures.h"
#include "capture/calibrate/sheet_colours.h"
#include "capture/calibrate/still_collector.h"
#include "capture/calibrate/stripe_stack.h"
#include "capture/rig_file.h"
#include "cli/progress.h"
#include "cli/size_option.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// Ends the source where the command is stopped.
class StoppedSource {
 public:
  StoppedSource(FieldSource& source, StopSignal& stop) : stop_(stop) {
    stop.on_stop([&source] { source.request_stop(); });
  }
  StoppedSource(const StoppedSource&) = delete;
  StoppedSource& operator=(const StoppedSource&) = delete;
  ~StoppedSource() { stop_.clear_on_stop(); }

 private:
  StopSignal& stop_;
};

/// Feeds frames until `taken` says that it is enough, asked each time that the scene came to rest. Frames
/// that cannot be read are warned of.
Status watch(FieldSource& source, std::size_t cycle, Progress& progress,
             const std::function<Result<bool>(const StillCollector&)>& taken) {
  StillCollector collector(cycle);
  constexpr int kMostErrors = 100;
  int errors = 0;
  for (std::uint64_t done = 0;;) {
    auto frame = source.next();
    if (!frame) {
      if (++errors == kMostErrors) return frame.error();
      log_warning(frame.error().message);
      continue;
    }
    if (!*frame) return {};
    errors = 0;
    if (collector.add(**frame)) {
      auto enough = taken(collector);
      if (!enough) return enough.error();
      if (*enough) return {};
    }
    progress.update(++done, std::to_string(collector.at_rest()) + " of " + std::to_string(cycle) +
                                " slides seen at rest");
  }
}

std::string view_name(int number) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%02d", number);
  return name;
}

/// Takes views into their folders.
class ViewTaker {
 public:
  ViewTaker(const LiveOptions& options, const Board& board, const SourceInfo& info)
      : options_(options),
        board_(board),
        info_(info),
        pool_(options.threads),
        coverage_(info.rig.camera, info.rig.projector) {
    std::error_code ignored;
    while (fs::exists(fs::path(options.folder) / view_name(next_), ignored)) ++next_;
  }

  /// True where there are enough.
  Result<bool> take(const StillCollector& collector) {
    const auto [width, height] = Size{info_.rig.projector.width, info_.rig.projector.height};
    auto stack = sort_stripes(collector.pairs(), info_.pattern, width, height, options_.colours, pool_);
    if (!stack) return not_used(stack.error().message);
    const std::string name = view_name(next_);
    const MeasuredView view = measure_view(name, *stack, board_, options_.colours, pool_);
    if (!view.refused.empty()) return not_used(view.refused);
    if (coverage_.repeats(view)) return not_used("the board is where it was in a view before; move it");
    const fs::path folder = fs::path(options_.folder) / name;
    const auto made = NewFolder::create(folder);
    if (!made) return made.error();
    if (const Status written = write_stripe_view(folder, *stack); !written) {
      std::error_code ignored;
      fs::remove_all(folder, ignored);  // this run's own: a part of it would be no view
      return written.error();
    }
    ++next_;
    ++taken_;
    log_info(name + " taken (" + std::to_string(taken_) + " of " + std::to_string(options_.views) +
             "): " + coverage_.add(view));
    if (taken_ < options_.views && !missing().empty()) log_info("still missing: " + missing());
    if (const Status drawn = draw(); !drawn) return drawn.error();
    return taken_ >= options_.views;
  }

  /// Into FOLDER/coverage.png.
  Status draw() const { return write_png(fs::path(options_.folder) / "coverage.png", coverage_.draw()); }

  int taken() const { return taken_; }
  std::string missing() const { return coverage_.missing(); }

 private:
  static Result<bool> not_used(const std::string& why) {
    log_info("at rest, but not used: " + why);
    return false;
  }

  const LiveOptions& options_;
  const Board& board_;
  const SourceInfo& info_;
  WorkerPool pool_;
  Coverage coverage_;
  int next_ = 0;  // number of the next view's folder
  int taken_ = 0;
};

}  // namespace

Result<SourceInfo> take_board_views(const LiveOptions& options, const Board& board, StopSignal& stop) {
  auto source = open_source(options.source, {.camera = options.camera});
  if (!source) return source.error();
  const SourceInfo info = (*source)->info();
  if (info.pattern.stripes() == 0) {
    return Error{
        options.source +
        " does not say what is projected: name it with --pattern pattern.yaml, as `pattern` writes it"};
  }
  if (info.rig.projector.width == 0) {
    return Error{options.source + " does not know the projector: give its size with --projector"};
  }
  const auto folder = NewFolder::create(options.folder);
  if (!folder) return folder.error();
  const fs::path pattern = fs::path(options.folder) / "pattern.yaml";
  std::error_code ignored;
  if (fs::exists(pattern, ignored)) {
    const auto before = read_pattern(pattern);
    if (!before || to_yaml(*before) != to_yaml(info.pattern)) {
      return Error{options.folder + " holds views of another pattern: give another folder"};
    }
  }
  if (const Status written = write_whole_file(pattern, to_yaml(info.pattern)); !written)
    return written.error();

  ViewTaker taker(options, board, info);
  if (const Status drawn = taker.draw(); !drawn) return drawn.error();
  log_info("hold the board still at " + std::to_string(options.views) +
           " poses, tilted differently each time, under the stripes along columns and rows; " +
           (fs::path(options.folder) / "coverage.png").string() + " shows what was seen");
  Progress progress("calibrate", "frames");
  {
    const StoppedSource ended(**source, stop);
    const Status watched = project_while(
        options.projector, {info.rig.projector.width, info.rig.projector.height},
        [&](Size size) {
          return draw_stripe_slides(info.pattern, size.width, size.height, Scan::kProgressive);
        },
        [&] {
          return watch(**source, 2 * static_cast<std::size_t>(info.pattern.slides), progress,
                       [&](const StillCollector& c) { return taker.take(c); });
        },
        stop);
    if (!watched) return watched.error();
  }
  progress.finish();
  const std::string kept =
      counted(taker.taken(), "view") + " of this run " + is_or_are(taker.taken()) + " in " + options.folder;
  if (stop.stopped()) {
    log_info(kept + ": the same command takes more, without --source it calibrates from what is there");
    return info;
  }
  if (taker.taken() == 0) {
    return Error{
        options.source +
        " ended without a view: the board must be held still under the stripes along columns and rows"};
  }
  if (taker.taken() < options.views) log_warning(options.source + " ended before all were taken; " + kept);
  if (!taker.missing().empty()) log_info("not covered: " + taker.missing());
  return info;
}

Status take_colour_captures(const LiveOptions& options, StopSignal& stop) {
  auto source = open_source(options.source, {.camera = options.camera});
  if (!source) return source.error();
  const auto folder = NewFolder::create(options.folder);
  if (!folder) return folder.error();
  Progress progress("calibrate", "frames");
  bool done = false;
  const StoppedSource ended(**source, stop);
  const auto take = [&](const StillCollector& collector) -> Result<bool> {
    std::vector<Image8> pictures = collector.pictures();
    const auto colours = tell_colours(pictures);
    if (!colours) {
      log_info("at rest, but not used: " + colours.error().message);
      return false;
    }
    std::vector<fs::path> files;
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      files.push_back(fs::path(options.folder) / (primary_name((*colours)[i]) + ".png"));
      if (const Status written = write_png(files.back(), pictures[i]); !written) {
        std::error_code ignored;
        for (const fs::path& file : files) fs::remove(file, ignored);  // some of them would be no captures
        return written.error();
      }
    }
    done = true;
    return true;
  };
  const Status watched = project_while(
      options.projector, {0, 0},
      [](Size size) -> Result<std::vector<Image8>> { return draw_sheet_colours(size.width, size.height); },
      [&] { return watch(**source, 4, progress, take); }, stop);
  if (!watched) return watched;
  if (stop.stopped() || done) return {};
  return Error{
      options.source +
      " ended without the captures: it must show a white sheet at rest under black, red, green and blue, "
      "each with its complement"};
}

}  // namespace relievo
