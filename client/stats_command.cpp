// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/live_reader.h"
#include "client/options.h"

namespace relievo {
namespace {

constexpr std::chrono::seconds kLine{1};

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string stream;
  std::string quality = "auto";
  double seconds = 0;  // 0: until it is stopped
  bool json = false;
};

std::string clock_text(const std::optional<ClockOffset>& clock) {
  if (!clock) return "clock not known";
  char text[80];
  std::snprintf(text, sizeof text, "clock %+.3f +- %.3f ms", milliseconds(clock->offset_ns),
                milliseconds(clock->delay_ns) / 2);
  return text;
}

std::string latency_text(const std::optional<double>& latency_ms) {
  if (!latency_ms) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", *latency_ms);
  return text;
}

/// It was asked for by name, and the stream is there without it.
bool lacks_quality(const Options& options, const LiveReader::Report& report) {
  const auto rung = rung_named(options.quality);
  return report.live && rung && *rung != Rung::kFull &&
         std::ranges::find(report.rungs, *rung) == report.rungs.end();
}

void print_line(const Options& options, const LiveReader::Report& before, const LiveReader::Report& now,
                double took_s) {
  if (lacks_quality(options, now)) {
    std::printf("%-8s the stream has no such quality\n", options.quality.c_str());
    std::fflush(stdout);
    return;
  }
  const double rate = static_cast<double>(now.frames - before.frames) / took_s;
  const double mbit_s = static_cast<double>(now.bytes - before.bytes) * 8e-6 / took_s;
  std::printf("%-8s %6.1f/s %8.2f Mbit/s %6llu lost %6llu skipped  decode %6.1f ms  latency %7s ms  %s%s\n",
              std::string(to_string(now.rung)).c_str(), rate, mbit_s,
              static_cast<unsigned long long>(now.lost - before.lost),
              static_cast<unsigned long long>(now.skipped - before.skipped), now.decode_ms,
              latency_text(now.latency_ms).c_str(), clock_text(now.clock).c_str(),
              now.live ? "" : "  (waiting for the stream)");
  std::fflush(stdout);
}

void print_json(const Options& options, const LiveReader::Report& report, double took_s) {
  using nlohmann::json;
  nlohmann::json j = {{"stream", options.stream},
                      {"quality", to_string(report.rung)},
                      {"seconds", took_s},
                      {"frames", report.frames},
                      {"bytes", report.bytes},
                      {"lost", report.lost},
                      {"skipped", report.skipped},
                      {"moves", report.moves},
                      {"decode_ms", report.frames > 0 ? json(report.decode_ms) : json()},
                      {"latency_ms", report.latency_ms ? json(*report.latency_ms) : json()},
                      {"clock_offset_ms", nullptr},
                      {"clock_error_ms", nullptr}};
  j["qualities"] = nlohmann::json::array({to_string(Rung::kFull)});
  for (const Rung rung : report.rungs) j["qualities"].push_back(to_string(rung));
  if (report.clock) {
    j["clock_offset_ms"] = milliseconds(report.clock->offset_ns);
    j["clock_error_ms"] = milliseconds(report.clock->delay_ns) / 2;
  }
  std::puts(json_text(j).c_str());
}

Status run(const Options& options, StopSignal& stop) {
  auto reader = LiveReader::create(
      {.domain = *options.domain, .stream = options.stream, .quality = rung_named(options.quality)});
  if (!reader) return reader.error();
  const std::int64_t begin_ns = steady_now_ns();
  LiveReader::Report before;
  std::int64_t before_ns = begin_ns;
  for (;;) {
    (*reader)->compare_clocks();
    std::chrono::nanoseconds wait = kLine;
    if (options.seconds > 0) {
      const auto left_ns = begin_ns + static_cast<std::int64_t>(options.seconds * 1e9) - steady_now_ns();
      wait = std::min<std::chrono::nanoseconds>(wait, std::chrono::nanoseconds(left_ns));
    }
    const bool stopped = wait.count() <= 0 || stop.wait_for(wait);
    const LiveReader::Report now = (*reader)->report();
    const std::int64_t now_ns = steady_now_ns();
    if (!options.json && now_ns > before_ns) print_line(options, before, now, seconds(now_ns - before_ns));
    before = now;
    before_ns = now_ns;
    if (std::ferror(stdout) != 0) return {};  // nobody reads on; the program says so
    if (stopped || (options.seconds > 0 && seconds(now_ns - begin_ns) >= options.seconds)) break;
  }
  if (options.json) print_json(options, before, seconds(before_ns - begin_ns));
  if (before.frames > 0 || stop.stopped()) return {};
  const bool missing_rung = before.live && options.quality != "auto" && options.quality != "full";
  return Error{missing_rung ? "stream '" + options.stream + "' has no quality " + options.quality +
                                  ": its server was started with another --ladder"
                            : "no frame of stream '" + options.stream +
                                  "' came: is its server running? `relievo "
                                  "streams` lists what there is"};
}

}  // namespace

Command stats_command() {
  return {
      "stats", "Decode a live stream and say what arrives: rate, losses, times, clocks", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        options->domain = add_domain_options(app);
        app.add_option("stream", options->stream, "Name of the stream")->type_name("NAME")->required();
        app.add_option(
               "--quality", options->quality,
               "full, reduced, texture, slow (that texture, a frame at a time as the network has room), or "
               "auto: lower while frames are lost, late or take too long, and back after a quiet time")
            ->check(CLI::IsMember({"auto", "full", "reduced", "texture", "slow"}))
            ->capture_default_str()
            ->type_name("NAME");
        app.add_option("--seconds", options->seconds, "End after so long (default: at Ctrl-C)")
            ->check(number(0.1, 1e9));
        app.add_flag("--json", options->json, "One JSON object at the end instead of a line a second");
        app.final_callback([options] { check_stream(options->stream); });
        app.footer(
            "Latency is from the capture until the frame is decoded here, with the difference of the two\n"
            "machines' clocks taken out (clock: how far the server's is ahead).\n\n"
            "Examples:\n"
            "  relievo stats face\n"
            "  relievo stats face --quality reduced --seconds 10 --json");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
