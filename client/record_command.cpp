// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "cli/progress.h"
#include "cli/quantities.h"
#include "client/commands.h"
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
  std::uint64_t frames = 0;
  double seconds = 0;
  double wait_s = -1;                                        // below 0: for ever
  std::string split_size, split_every, keep_size, keep_for;  // quantities; empty: none
  bool json = false;
};

std::string default_file(const std::string& stream) {
  std::string time = utc_text(utc_now_ns());
  std::erase_if(time, [](char c) { return c == '-' || c == ':'; });
  return stream + '-' + time + ".mcap";
}

// The texts were checked when they were given.
SegmentOptions segments_of(const Options& options) {
  SegmentOptions out;
  if (!options.split_size.empty()) out.split_bytes = parse_bytes(options.split_size).value();
  if (!options.split_every.empty()) out.split_s = parse_duration_s(options.split_every).value();
  if (!options.keep_size.empty()) out.keep_bytes = parse_bytes(options.keep_size).value();
  if (!options.keep_for.empty()) out.keep_s = parse_duration_s(options.keep_for).value();
  return out;
}

// Found out before waiting for a stream rather than after.
Status check_target(const std::filesystem::path& file, bool split) {
  std::error_code error;
  if (!split && std::filesystem::exists(file, error)) {
    return Error{file.string() + " exists already: name another file with --out, or remove it"};
  }
  const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder, error)) {
    return Error{folder.string() + " is no folder: make it first, or name another file with --out"};
  }
  return {};
}

std::string lost_note(std::uint64_t lost) {
  return lost > 0 ? std::to_string(lost) + " lost" : std::string();
}

// Until the recorder is done, the stream stays away too long, or somebody stops us.
Status watch(const Options& options, Recorder& recorder, StopSignal& stop) {
  Progress progress("record", "frames", options.frames);
  std::int64_t last_live_ns = steady_now_ns();
  bool said_waiting = false;
  while (!recorder.done() && !stop.wait_for(kTick)) {
    recorder.tick(utc_now_ns());
    const Recorder::Counts counts = recorder.counts();
    const std::int64_t now_ns = steady_now_ns();
    if (counts.live) last_live_ns = now_ns;
    const std::int64_t absent_ns = now_ns - last_live_ns;
    if (counts.frames == 0 && !counts.live && !said_waiting && absent_ns >= kSayWaitingAfter_ns) {
      log_info("waiting for stream '" + options.stream + "' in domain " +
               std::to_string(options.domain->domain) + " (`relievo streams` lists what there is)");
      said_waiting = true;
    }
    if (options.wait_s >= 0 && seconds(absent_ns) > options.wait_s) {
      if (counts.frames > 0) return {};
      return Error{"no stream '" + options.stream + "' in domain " + std::to_string(options.domain->domain) +
                   ": is its server running? `relievo streams` lists what there is"};
    }
    progress.update(counts.frames, bytes_text(counts.bytes) + "  " + lost_note(counts.lost));
  }
  return {};
}

void report(const Options& options, const Recorder::Counts& counts) {
  if (options.json) {
    const nlohmann::json j = {{"file", counts.bytes > 0 ? options.file : ""},
                              {"stream", options.stream},
                              {"files", counts.files},
                              {"frames", counts.frames},
                              {"lost", counts.lost},
                              {"bytes", counts.bytes},
                              {"duration_s", counts.duration_s}};
    std::puts(j.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else if (counts.bytes == 0) {
    std::puts("nothing was received; no file was written");
  } else {
    const std::string files =
        counts.files > 1 ? " (" + std::to_string(counts.files) + " files)" : std::string();
    std::printf("%s%s: %llu frames in %s, %s, %llu lost\n", options.file.c_str(), files.c_str(),
                static_cast<unsigned long long>(counts.frames), duration_text(counts.duration_s).c_str(),
                bytes_text(counts.bytes).c_str(), static_cast<unsigned long long>(counts.lost));
  }
}

Status run(Options options, StopSignal& stop) {
  if (options.file.empty()) options.file = default_file(options.stream);
  const SegmentOptions segments = segments_of(options);
  if (auto status = check_target(options.file, segments.split()); !status) return status;
  Recorder recorder({.file = options.file,
                     .stream = options.stream,
                     .max_frames = options.frames,
                     .max_s = options.seconds,
                     .segments = segments});
  auto subscriber = Subscriber::create(*options.domain, options.stream, recorder.callbacks());
  if (!subscriber) return subscriber.error();
  const Status watched = watch(options, recorder, stop);
  subscriber->reset();
  const Status finished = recorder.finish();
  const Recorder::Counts counts = recorder.counts();
  if (!finished) {
    return finished.error().in("recording stopped after " + std::to_string(counts.frames) + " frames");
  }
  if (!watched) return watched;
  if (counts.lost > 0) {
    log_warning(std::to_string(counts.lost) +
                " frames were lost before they could be recorded: the network or the "
                "disk was too slow");
  }
  report(options, counts);
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
        app.add_option("--frames", options->frames, "Stop after this many frames")->check(whole_number(1));
        app.add_option("--seconds", options->seconds, "Stop this many seconds after the first frame")
            ->check(number(0.001, 1e9));
        app.add_option("--wait", options->wait_s,
                       "Seconds to wait for the stream, at first and when it has gone (default: for ever)")
            ->check(number(0, 1e9));
        auto* size = app.add_option("--split-size", options->split_size,
                                    "Begin a new file, FILE_000001.mcap, where one is as large, e.g. 2GB")
                         ->type_name("SIZE")
                         ->check(byte_count());
        auto* every = app.add_option("--split-every", options->split_every, "or as long, e.g. 10min")
                          ->type_name("TIME")
                          ->check(duration());
        auto* keep_size = app.add_option("--keep-size", options->keep_size,
                                         "Remove the oldest of these files while all are larger, e.g. 100GB")
                              ->type_name("SIZE")
                              ->check(byte_count());
        auto* keep_for =
            app.add_option("--keep-for", options->keep_for, "Remove those that ended longer ago, e.g. 7d")
                ->type_name("TIME")
                ->check(duration());
        app.add_flag("--json", options->json, "Print the result as JSON");
        app.final_callback([size, every, keep_size, keep_for] {
          const bool keeps = !keep_size->empty() || !keep_for->empty();
          if (keeps && size->empty() && every->empty()) {
            throw CLI::ValidationError("--keep-size, --keep-for",
                                       "remove whole files: give --split-size or --split-every too");
          }
        });
        app.footer(
            "Examples:\n"
            "  relievo record face --out face.mcap --seconds 10\n"
            "  relievo record face --out face.mcap --split-every 10min --keep-size 100GB");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
