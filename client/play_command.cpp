// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "client/commands.h"
#include "client/options.h"
#include "client/player.h"
#include "client/recorded_stream.h"
#include "client/time_range.h"

namespace relievo {
namespace {

constexpr std::int64_t kBriefWait_ns = kNanosecondsPerSecond;

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string file;
  std::string stream;
  PlayOptions play;
  bool once = false;
  int readers = -1;  // below 0: wait for one, briefly
  std::shared_ptr<RangeOptions> range;
  bool json = false;
};

// Frames written before a reader is matched never reach it.
void wait_for_readers(const Options& options, const RawPublisher& publisher, StopSignal& stop) {
  const std::int64_t start_ns = steady_now_ns();
  const int wanted = options.readers < 0 ? 1 : options.readers;
  bool said = false;
  while (publisher.matched_readers() < wanted && !stop.wait_for(std::chrono::milliseconds(10))) {
    const std::int64_t waited_ns = steady_now_ns() - start_ns;
    if (options.readers < 0 && waited_ns > kBriefWait_ns) return;
    if (!said && waited_ns > kBriefWait_ns) {
      log_info("waiting for " + counted(static_cast<std::uint64_t>(wanted), "reader"));
      said = true;
    }
  }
  // Matched here does not yet mean matched there.
  if (publisher.matched_readers() > 0) stop.wait_for(std::chrono::milliseconds(200));
}

Status run(const Options& options, StopSignal& stop) {
  auto recorded = RecordedStream::open(options.file, options.stream);
  if (!recorded) return recorded.error();
  if (!options.play.follow) recorded->warn_if_cut();
  const auto infos = recorded->read_infos();
  if (!infos) return infos.error();
  const auto range = find_range(*options.range, *recorded);
  if (!range) return range.error().in(options.file);
  PlayOptions play_options = options.play;
  play_options.range = *range;
  auto publisher = RawPublisher::create(*options.domain, recorded->stream());
  if (!publisher) return publisher.error();
  Bytes current_info;
  // Before there are readers: what the first frame needs.
  if (const RecordedInfo* info = info_at(range->from_ns, *infos)) {
    if (auto status = (*publisher)->publish(info->sample); !status) return status;
    current_info = info->sample.cdr;
  } else {
    log_warning(options.file + " holds no description of its stream: viewers will lack its calibration");
  }
  log_info("playing " + options.file + " as stream '" + recorded->stream() + "' in domain " +
           std::to_string(options.domain->domain));
  wait_for_readers(options, **publisher, stop);

  std::uint64_t frames = 0, refused = 0;
  Progress progress("play", "frames", options.play.loop || options.play.follow ? 0 : range->frames);
  const Status played = play(*recorded, play_options, stop, [&](const RawSample& sample) -> Status {
    if (sample.topic == Topic::kInfo && sample.cdr == current_info) return {};
    if (auto status = (*publisher)->publish(sample); !status) {
      if (++refused == 1) log_warning(status.error().message + " (skipped; further ones silently)");
      return {};
    }
    if (sample.topic == Topic::kInfo) current_info = sample.cdr;
    if (sample.topic == Topic::kFrame) progress.update(++frames);
    return {};
  });
  progress.finish();
  publisher->reset();  // returns when the last frames have arrived
  if (!played) return played;
  if (frames == 0 && refused > 0) return Error{"no sample of " + options.file + " could be published"};
  if (options.json) {
    std::puts(json_text(nlohmann::json({{"stream", recorded->stream()},
                                        {"frames", frames},
                                        {"refused", refused},
                                        {"damaged", recorded->damaged()}}))
                  .c_str());
  } else {
    std::printf("%s played\n", counted(frames, "frame").c_str());
  }
  if (refused > 0)
    return Error{counted(refused, "sample") + " of " + options.file +
                 " could not be published; the others were played"};
  return {};
}

}  // namespace

Command play_command() {
  return {"play", "Play a recording onto the network at its original pace", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            options->domain = add_domain_options(app);
            app.add_option("file", options->file, "Recording")->type_name("FILE")->required();
            app.add_option("--stream", options->stream, "Which stream, where the file holds several")
                ->type_name("NAME");
            app.add_option("--speed", options->play.speed, "Speed: 2 is twice as fast")
                ->check(number(0.01, 100))
                ->capture_default_str();
            auto* loop = app.add_flag("--loop", options->play.loop, "Start again at the end, until stopped");
            app.add_flag("--follow", options->play.follow,
                         "Where the file is being written, go on at its end with what comes until it is "
                         "finished")
                ->excludes(loop);
            app.add_flag("--once", options->once, "Stop at the end (the default)")->excludes(loop);
            app.add_option("--wait-readers", options->readers,
                           "Start when this many readers are there (default: one, but wait a second at most)")
                ->check(whole_number(0, 1000));
            app.add_option("--longest-pause", options->play.longest_pause_s,
                           "Shorten longer pauses, where the stream was gone say, to this many seconds "
                           "(default: as they were)")
                ->check(number(0.001, 1e9));
            app.add_flag("--restamp", options->play.restamp,
                         "Frames are said to be captured now, as far apart as they are played, for "
                         "readers that measure latency; everything else stays as recorded");
            options->range = add_range_options(app);
            app.add_flag("--json", options->json, "Print the result as JSON");
            app.footer(
                "Examples:\n"
                "  relievo play face.mcap --loop --speed 0.5\n"
                "  relievo play face.mcap --from 60 --to 75.5\n"
                "  relievo play face.mcap --follow");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
