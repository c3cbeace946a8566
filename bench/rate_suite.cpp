// SPDX-License-Identifier: Apache-2.0
// The levels of server/rate_control.cpp on a source: what its table is measured with.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <numeric>

#include "base/time.h"
#include "bench/frames.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
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
  Repeats repeats{.frames = 30};
  bool json = false;
};

struct Samples {
  std::vector<double> bytes, key_bytes, encode_ms, texture_db;
  double sum_bytes = 0;
  double mean_bytes() const { return sum_bytes / static_cast<double>(bytes.size() + key_bytes.size()); }
};

EncodeOptions options_of(const Options& asked, const RateLevel& level) {
  EncodeOptions options;
  set_geometry_profile(asked.geometry, options);
  options.texture = texture_codec_named(asked.texture).value_or(options.texture);
  if (options.texture == TextureCodec::kH264) options.key_interval = 30;
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

Status run(const Options& options, StopSignal& stop) {
  const auto loop = FrameLoop::load(options.source, options.repeats.frames + 1, stop);
  if (!loop) return loop.error();
  if (!*loop) return {};
  const auto frames = reconstruct_all(**loop, ReconstructOptions{}.decoder, stop);
  if (!frames) return frames.error();
  if (!*frames) return {};

  // Round by round, so that whatever else the machine does meets all levels alike.
  const auto levels = rate_levels();
  std::vector<Samples> samples(levels.size());
  for (int round = 0; round < options.repeats.rounds; ++round) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      if (stop.stopped()) return {};
      if (const Status done = measure(**loop, **frames, options_of(options, levels[l]), samples[l]); !done)
        return done;
    }
  }
  const double rate = (*loop)->info().rig.frame_rate;
  std::vector<Row> rows;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const Samples& of = samples[l];
    rows.push_back({std::to_string(l),
                    {{"texture_quality", static_cast<double>(levels[l].texture_quality)},
                     {"step_bits", static_cast<double>(levels[l].step_bits)},
                     {"sigmas", levels[l].sigmas},
                     {"every_line", levels[l].every_line},
                     {"mean_bytes", of.mean_bytes()},
                     {"mbit_per_s", 8e-6 * rate * of.mean_bytes()},
                     {"size", of.mean_bytes() / samples[0].mean_bytes()},
                     {"encode_ms", spread_of(of.encode_ms)},
                     {"time", usual(of.encode_ms) / usual(samples[0].encode_ms)},
                     {"texture_db", of.texture_db.empty() ? Value() : Value(usual(of.texture_db))}}});
  }
  print({.suite = "rate",
         .settings = {{"source", options.source},
                      {"geometry", options.geometry},
                      {"texture", options.texture},
                      {"frames", static_cast<double>((*frames)->size())},
                      {"rounds", static_cast<double>(options.repeats.rounds)}},
         .figures = {{"frame_rate", rate}},
         .rows = std::move(rows),
         .notes = {"Reference: level 0. size, time: of that. PSNR: of the textures that decode alone."}},
        options.json);
  return {};
}

}  // namespace

Command rate_suite() {
  return {"rate", "Levels of the rate control: bytes, time and PSNR", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            add_codec_options(app, options->geometry, options->texture);
            add_repeat_options(app, options->repeats, 2);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
