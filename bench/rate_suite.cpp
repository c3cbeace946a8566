// SPDX-License-Identifier: Apache-2.0
// The levels of server/rate_control.cpp on a source: what its table is measured with; or how well the control
// keeps deadlines on this machine.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <numeric>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "cli/checks.h"
#include "codec/frame3d_codec.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "server/rate_control.h"
#include "server/texture_look.h"

namespace relievo::bench {
namespace {

struct Options {
  std::string source = "sim:walk";
  std::string geometry = "metric", texture = "h264";
  std::vector<double> deadlines_ms;
  Repeats repeats{.frames = 30};
  bool json = false;
};

struct Samples {
  std::vector<double> bytes, key_bytes, encode_ms, texture_db;
  double sum_bytes = 0;
  double mean_bytes() const { return sum_bytes / static_cast<double>(bytes.size() + key_bytes.size()); }
};

EncodeOptions finest(const Options& asked) {
  EncodeOptions options;
  set_geometry_profile(asked.geometry, options);
  options.texture = texture_codec_named(asked.texture).value_or(options.texture);
  if (options.texture == TextureCodec::kH264) options.key_interval = 30;
  const RateLevel& level = rate_levels().front();
  options.texture_quality = level.texture_quality;
  options.step_bits = level.step_bits;
  return options;
}

EncodeOptions options_of(const Options& asked, const RateLevel& level) {
  EncodeOptions options = finest(asked);
  options.texture_quality = level.texture_quality;
  options.step_bits = level.step_bits;
  options.quality = options.quality && level.sigmas;
  options.halve_lines = !level.every_line;
  return options;
}

Status measure(const FrameLoop& loop, const std::vector<Frame3D>& frames, const EncodeOptions& options,
               Samples& samples) {
  FrameEncoder encoder(loop.info().rig, loop.info().pattern);
  bool warm = false;
  for (const Frame3D& frame : frames) {
    const std::int64_t begin = steady_now_ns();
    const auto bytes = encoder.encode(frame, options);
    const std::int64_t end = steady_now_ns();
    if (!bytes) return bytes.error();
    const bool is_key = is_key_frame(*bytes);
    (is_key ? samples.key_bytes : samples.bytes).push_back(static_cast<double>(bytes->size()));
    samples.sum_bytes += static_cast<double>(bytes->size());
    if (std::exchange(warm, true)) samples.encode_ms.push_back(milliseconds(end - begin));
    if (const auto db = texture_db(*bytes, frame.texture)) samples.texture_db.push_back(*db);
  }
  return {};
}

/// The mean of the quarter in the middle: less at the mercy of what else the machine does than a median.
double usual(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto n = static_cast<std::ptrdiff_t>(values.size());
  const auto from = values.begin() + n * 3 / 8, to = values.begin() + (n * 5 + 7) / 8;
  return std::accumulate(from, to, 0.0) / static_cast<double>(to - from);
}

Result<Row> row_of_deadline(const FrameLoop& loop, const std::vector<Frame3D>& frames, const Options& asked,
                            double deadline_ms) {
  constexpr int kSettled = 60;  // frames until the control has seen enough
  const EncodeOptions finest_options = finest(asked);
  RateControl control({.deadline_ms = deadline_ms}, loop.info().rig.frame_rate, finest_options);
  FrameEncoder encoder(loop.info().rig, loop.info().pattern);
  std::vector<double> took_ms, places;
  const int count = kSettled + asked.repeats.rounds * static_cast<int>(frames.size());
  for (int i = 0; i < count; ++i) {
    EncodeOptions options = finest_options;
    control.apply(options);
    const double place = control.place();
    const std::int64_t begin = steady_now_ns();
    const auto bytes = encoder.encode(frames[static_cast<std::size_t>(i) % frames.size()], options);
    const double ms = milliseconds(steady_now_ns() - begin);
    if (!bytes) return bytes.error();
    control.took(ms, place);
    control.add(bytes->size(), is_key_frame(*bytes), options.key_interval);
    if (i < kSettled) continue;
    took_ms.push_back(ms);
    places.push_back(place);
  }
  const auto late =
      std::count_if(took_ms.begin(), took_ms.end(), [&](double ms) { return ms > deadline_ms; });
  std::vector<double> sorted = took_ms;
  std::sort(sorted.begin(), sorted.end());
  return Row{"deadline",
             {{"deadline_ms", deadline_ms},
              {"encode_ms", spread_of(took_ms)},
              {"encode_ms_p95", sorted[(sorted.size() * 95 - 1) / 100]},
              {"late_share", static_cast<double>(late) / static_cast<double>(took_ms.size())},
              {"level", spread_of(places)}}};
}

Result<std::vector<Row>> rows_of_deadlines(const FrameLoop& loop, const std::vector<Frame3D>& frames,
                                           const Options& asked, StopSignal& stop) {
  std::vector<Row> rows;
  for (const double deadline_ms : asked.deadlines_ms) {
    if (stop.stopped()) return rows;
    auto row = row_of_deadline(loop, frames, asked, deadline_ms);
    if (!row) return row.error();
    rows.push_back(std::move(*row));
  }
  return rows;
}

Result<std::vector<Row>> rows_of_levels(const FrameLoop& loop, const std::vector<Frame3D>& frames,
                                        const Options& asked, StopSignal& stop) {
  // Round by round, so that whatever else the machine does meets all levels alike.
  const auto levels = rate_levels();
  std::vector<Samples> samples(levels.size());
  for (int round = 0; round < asked.repeats.rounds; ++round) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      if (stop.stopped()) return std::vector<Row>{};
      if (const Status done = measure(loop, frames, options_of(asked, levels[l]), samples[l]); !done)
        return done.error();
    }
  }
  std::vector<Row> rows;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const Samples& of = samples[l];
    rows.push_back({std::to_string(l),
                    {{"texture_quality", static_cast<double>(levels[l].texture_quality)},
                     {"step_bits", static_cast<double>(levels[l].step_bits)},
                     {"sigmas", levels[l].sigmas},
                     {"every_line", levels[l].every_line},
                     {"mean_bytes", of.mean_bytes()},
                     {"mbit_per_s", 8e-6 * loop.info().rig.frame_rate * of.mean_bytes()},
                     {"size", of.mean_bytes() / samples[0].mean_bytes()},
                     {"encode_ms", spread_of(of.encode_ms)},
                     {"time", usual(of.encode_ms) / usual(samples[0].encode_ms)},
                     {"texture_db", of.texture_db.empty() ? Value() : Value(usual(of.texture_db))}}});
  }
  return rows;
}

Status run(const Options& options, StopSignal& stop) {
  const auto loaded = load_reconstructed(options.source, options.repeats.frames + 1, stop);
  if (!loaded) return loaded.error();
  if (!*loaded) return {};
  const auto& [loop, frames] = **loaded;

  const bool of_deadlines = !options.deadlines_ms.empty();
  auto rows = of_deadlines ? rows_of_deadlines(loop, frames, options, stop)
                           : rows_of_levels(loop, frames, options, stop);
  if (!rows) return rows.error();
  if (stop.stopped()) return {};
  print({.suite = "rate",
         .settings = {{"source", options.source},
                      {"geometry", options.geometry},
                      {"texture", options.texture},
                      {"frames", static_cast<double>(frames.size())},
                      {"rounds", static_cast<double>(options.repeats.rounds)}},
         .figures = {{"frame_rate", loop.info().rig.frame_rate}},
         .rows = std::move(*rows),
         .notes =
             {of_deadlines
                  ? "Encoding alone, under a control that is told how long each frame took; of frames after "
                    "the first 60. late_share: of them, longer than the deadline. level: 0 is the finest."
                  : "Reference: level 0. size, time: of that. PSNR: of the textures that decode alone."}},
        options.json);
  return {};
}

}  // namespace

Command rate_suite() {
  return {"rate", "Levels of the rate control: bytes, time and PSNR; or how it keeps deadlines",
          [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            add_codec_options(app, options->geometry, options->texture);
            app.add_option("--deadline", options->deadlines_ms,
                           "Milliseconds in which frames are to be encoded, several too: how they are kept, "
                           "instead of levels")
                ->check(number(1e-6))
                ->type_name("MS");
            add_repeat_options(app, options->repeats, 2);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
