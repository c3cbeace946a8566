// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/counted.h"
#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/recording_flags.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/options.h"
#include "idl/recorder.h"

namespace relievo {
namespace {

constexpr std::chrono::milliseconds kTick{100};
constexpr std::int64_t kSayWaitingAfter_ns = kNanosecondsPerSecond;

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string stream;
  std::string file;
  std::string quality = "full";
  std::uint64_t frames = 0;
  double seconds = 0;
  double wait_s = -1;  // below 0: for ever
  std::shared_ptr<RecordingTexts> recording;
  bool foxglove = false;
  bool json = false;
};

std::string default_file(const std::string& stream) {
  std::string time = utc_text(utc_now_ns());
  std::erase_if(time, [](char c) { return c == '-' || c == ':'; });
  return stream + '-' + time + ".mcap";
}

std::string lost_note(std::uint64_t lost) {
  return lost > 0 ? std::to_string(lost) + " lost" : std::string();
}

/// Whether a stream has the quality that is recorded, as its status says.
bool has_quality(const ServerStatus& status, Rung rung) {
  return rung == Rung::kFull ||
         std::ranges::any_of(status.rungs, [&](const RungStatus& r) { return r.rung == rung; });
}

// Until the recorder is done, the stream stays away too long, or somebody stops us. `misses`: it lacks the
// quality.
Status watch(const Options& options, Recorder& recorder, Subscriber& subscriber,
             const std::atomic<bool>& misses, StopSignal& stop) {
  Progress progress("record", "frames", options.frames);
  std::int64_t last_live_ns = steady_now_ns();
  bool said_waiting = false, said_missing = false;
  const std::string missing = "stream '" + options.stream + "' has no quality '" + options.quality + "'";
  while (!recorder.done() && !stop.wait_for(kTick)) {
    const std::int64_t now_ns = steady_now_ns();
    recorder.tick(now_ns);
    if (recorder.wants_key_frame(now_ns)) subscriber.request_key_frame(options.stream);
    const Recorder::Counts counts = recorder.counts();
    if (misses && !std::exchange(said_missing, true))
      log_warning(missing +
                  ": nothing of it is recorded until its server has (serve --ladder); what there is, " +
                  "is --quality full");
    if (counts.live && !misses) last_live_ns = now_ns;
    const std::int64_t absent_ns = now_ns - last_live_ns;
    if (counts.frames == 0 && !counts.live && !said_waiting && absent_ns >= kSayWaitingAfter_ns) {
      log_info("waiting for stream '" + options.stream + "' in domain " +
               std::to_string(options.domain->domain) + " (`relievo streams` lists what there is)");
      said_waiting = true;
    }
    if (options.wait_s >= 0 && seconds(absent_ns) > options.wait_s) {
      if (counts.frames > 0) return {};
      if (counts.live) return Error{missing + ": its server was started with another --ladder"};
      return Error{"no stream '" + options.stream + "' in domain " + std::to_string(options.domain->domain) +
                   ": is its server running? `relievo streams` lists what there is"};
    }
    progress.update(counts.frames, bytes_text(counts.bytes) + "  " + lost_note(counts.lost));
  }
  return {};
}

void report(const Options& options, const Recorder& recorder) {
  const Recorder::Counts counts = recorder.counts();
  const std::vector<std::filesystem::path> files = recorder.files();
  const std::uint64_t removed = counts.files - files.size();
  if (options.json) {
    std::vector<std::string> paths;
    for (const auto& file : files) paths.push_back(file.string());
    const nlohmann::json j = {{"file", recorder.file().string()},
                              {"stream", options.stream},
                              {"files", files.size()},
                              {"paths", paths},
                              {"removed_files", removed},
                              {"frames", counts.frames},
                              {"lost", counts.lost},
                              {"bytes", counts.bytes},
                              {"duration_s", counts.duration_s}};
    std::puts(json_text(j).c_str());
  } else if (files.empty()) {
    std::puts("nothing was received; no file was written");
  } else {
    std::string name = files.front().string();
    if (files.size() > 1)
      name += " to " + files.back().filename().string() + " (" + std::to_string(files.size()) + " files)";
    std::printf("%s: %s in %s, %s, %llu lost\n", name.c_str(), counted(counts.frames, "frame").c_str(),
                duration_text(counts.duration_s).c_str(), bytes_text(counts.bytes).c_str(),
                static_cast<unsigned long long>(counts.lost));
    if (removed > 0)
      std::printf("of these, what was in the first %s was removed, as --keep-size and --keep-for say\n",
                  removed == 1 ? "file" : counted(removed, "file").c_str());
  }
}

Status run(Options options, StopSignal& stop) {
  if (options.file.empty()) options.file = default_file(options.stream);
  const auto recording = recording_options(*options.recording);
  if (!recording) return recording.error();
  // Found out before waiting for a stream rather than after.
  if (auto status = check_recording_target(options.file, recording->segments.split()); !status) return status;
  Recorder recorder({.file = options.file,
                     .stream = options.stream,
                     .max_frames = options.frames,
                     .max_s = options.seconds,
                     .foxglove = options.foxglove,
                     .recording = *recording});
  const Rung rung = rung_named(options.quality).value_or(Rung::kFull);
  std::atomic<bool> misses{false};
  auto callbacks = recorder.callbacks();
  callbacks.status = [&](const ServerStatus& status) { misses = !has_quality(status, rung); };
  auto subscriber = Subscriber::create(*options.domain, options.stream, std::move(callbacks), rung);
  if (!subscriber) return subscriber.error();
  const Status watched = watch(options, recorder, **subscriber, misses, stop);
  subscriber->reset();
  const Status finished = recorder.finish();
  const Recorder::Counts counts = recorder.counts();
  if (!finished) {
    const std::string missed =
        counts.missed > 0 ? " and missed " + std::to_string(counts.missed) : std::string();
    return finished.error().in("recording stopped after " + counted(counts.frames, "frame") + missed);
  }
  if (!watched) return watched;
  if (counts.lost > 0) {
    log_warning(counted(counts.lost, "frame") + (counts.lost == 1 ? " was" : " were") +
                " lost before recording: the network or the disk was too slow");
  }
  report(options, recorder);
  return {};
}

}  // namespace

Command record_command() {
  return {
      "record", "Record a live stream to an MCAP file until Ctrl-C", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        options->domain = add_domain_options(app);
        app.add_option("stream", options->stream, "Name of the stream")->type_name("NAME")->required();
        app.add_option("--out", options->file, "New file to write (default: STREAM-TIME.mcap)")
            ->type_name("FILE");
        app.add_option("--quality", options->quality,
                       "full, or one of the server's ladder: reduced (every second line, half the texture's "
                       "size), texture (that texture alone), slow (likewise, a frame at a time as the "
                       "network has room)")
            ->check(CLI::IsMember({"full", "reduced", "texture", "slow"}))
            ->capture_default_str()
            ->type_name("NAME");
        app.add_option("--frames", options->frames, "Stop after this many frames")->check(whole_number(1));
        app.add_option("--seconds", options->seconds, "Stop this many seconds after the first frame")
            ->check(number(0.001, 1e9));
        app.add_option("--wait", options->wait_s,
                       "Seconds to wait for the stream, at first and when it has gone (default: for ever)")
            ->check(number(0, 1e9));
        options->recording = add_recording_flags(app);
        app.add_flag(
            "--foxglove", options->foxglove,
            "Besides, the texture as foxglove.CompressedImage with its CameraCalibration, and the surface as "
            "foxglove.SceneUpdate, which generic viewers show, in many times the bytes");
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.final_callback([options] {
          check_stream(options->stream);
          if (const auto all = recording_options(*options->recording); !all)
            throw CLI::ValidationError("--keep-size, --keep-for", all.error().message);
        });
        app.footer(
            "Examples:\n"
            "  relievo record face --out face.mcap --seconds 10\n"
            "  relievo record face --out face.mcap --split-every 10min --keep-size 100GB");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
