// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <utility>

#include "cli/checks.h"
#include "cli/quantities.h"
#include "cli/size_option.h"
#include "cli/web_flags.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "server/camera_flags.h"
#include "server/commands.h"
#include "server/config.h"
#include "server/options.h"
#include "server/serve.h"

namespace relievo {
namespace {

/// Flags as given; what is not given leaves the file's or the default value.
struct Flags {
  std::optional<std::string> config, source, stream, interface, keys, web, record, record_folder, pre_roll,
      projector;
  std::optional<std::string> decoder, geometry, texture, texture_encoder, bit_rate, ladder;
  std::string scheme;
  std::shared_ptr<RecordingTexts> recording;
  std::shared_ptr<WebOptions> gateway;
  std::optional<int> refreshes;
  Size projector_size;
  std::optional<int> domain, threads, texture_quality, draco_speed, step_bits, key_interval, fill_holes;
  std::optional<double> bound_px, deadline_ms, texture_db;
  std::optional<std::uint64_t> frames;
  std::optional<bool> loop, fast, half_lines, dense;
  CameraOptions camera;
};

/// Where the flag was given.
template <typename Flag, typename Field>
void set(const Flag& flag, Field& field) {
  if (flag) field = *flag;
}

/// --NAME, or --NAME=false where the file says true.
void add_switch(CLI::App& app, const std::string& name, std::optional<bool>& out, const std::string& help) {
  app.add_flag_function(
      name, [&out](std::int64_t given) { out = given > 0; }, help);
}

void set_stream(const Flags& flags, StreamConfig& config) {
  set(flags.source, config.source);
  set(flags.stream, config.stream);
  set(flags.record, config.record);
  if (flags.record) config.record_beside = false;  // there is a person who can give another name
  set(flags.threads, config.threads);
  if (!flags.scheme.empty()) config.scheme = flags.scheme;
  if (flags.decoder) set_decoder(*flags.decoder, config);
  if (flags.texture) config.texture = texture_codec_named(*flags.texture).value_or(config.texture);
  if (flags.texture_encoder)
    config.texture_encoder = video_encoder_named(*flags.texture_encoder).value_or(config.texture_encoder);
  if (flags.texture_quality) config.texture_quality = flags.texture_quality;
  set(flags.deadline_ms, config.rate.deadline_ms);
  set(flags.texture_db, config.rate.texture_db);
  if (flags.bit_rate)
    config.rate.bit_rate = parse_bit_rate(*flags.bit_rate).value();  // the option is checked
  set(flags.geometry, config.geometry);
  set(flags.step_bits, config.step_bits);
  set(flags.key_interval, config.key_interval);
  set(flags.bound_px, config.bound_px);
  set(flags.draco_speed, config.draco_speed);
  if (flags.ladder) config.ladder = parse_ladder(*flags.ladder).value();  // the option is checked
  set(flags.fill_holes, config.surface.fill_holes);
  set(flags.half_lines, config.half_lines);
  set(flags.dense, config.surface.dense);
  if (flags.frames) config.frames = flags.frames;
  set(flags.loop, config.loop);
  set(flags.fast, config.fast);
  config.camera = merged(std::move(config.camera), flags.camera);
}

/// Flags that say what one stream is cannot be meant for several.
Status check_flags(const Flags& flags, const ServeConfig& config) {
  if (config.streams.empty()) return {};
  for (const auto& [given, name] :
       {std::pair(flags.source.has_value(), "--source"), std::pair(flags.stream.has_value(), "--stream"),
        std::pair(flags.record.has_value(), "--record"),
        std::pair(flags.camera != CameraOptions(), "flags of a camera")}) {
    if (given)
      return Error{*flags.config + " has tables [[stream]]: leave out " + name + ", which are of one stream"};
  }
  return {};
}

/// The file as it is now, and the flags over it.
Result<ServeConfig> read(const Flags& flags) {
  ServeConfig config;
  SettingLines lines;
  if (flags.config) {
    if (const Status done = read_config(*flags.config, config, &lines); !done) return done.error();
  }
  if (const Status meant = check_flags(flags, config); !meant) return meant.error();
  set(flags.interface, config.interface);
  set(flags.keys, config.keys);
  set(flags.web, config.web);
  set(flags.domain, config.domain);
  set(flags.record_folder, config.record_folder);
  set(flags.pre_roll, config.pre_roll);
  set(flags.projector, config.projector.output);
  set(flags.refreshes, config.projector.refreshes);
  if (flags.projector_size.width > 0) {
    config.projector.width = flags.projector_size.width;
    config.projector.height = flags.projector_size.height;
  }
  config.recording = merged(*flags.recording, std::move(config.recording));
  config.gateway = merged(*flags.gateway, std::move(config.gateway));
  set_stream(flags, config);
  for (StreamConfig& stream : config.streams) set_stream(flags, stream);
  if (const auto mistake = find_mistake(config))
    return flags.config ? mistake_in(*flags.config, lines, *mistake) : mistake->error;
  return config;
}

Status run(const Flags& flags, StopSignal& stop) {
  const auto config = read(flags);
  if (!config) return config.error();
  const ReadAgain again = flags.config ? ReadAgain([&flags] { return read(flags); }) : nullptr;
  return serve(*config, again, stop);
}

}  // namespace

Command serve_command() {
  return {
      "serve", "Capture, reconstruct and stream", [](CLI::App& app) {
        auto f = std::make_shared<Flags>();
        app.add_option("--config", f->config,
                       "TOML file with these settings, of one stream or several; flags win. SIGHUP reads it "
                       "again")
            ->type_name("FILE");
        app.add_option(
               "--source", f->source,
               "sim:SCENE[,KEY=VALUE...] (simulate --help lists them), take:DIR or v4l2:DEVICE (default "
               "sim:face)")
            ->type_name("SOURCE");
        add_scheme_option(app, f->scheme);
        app.add_option("--stream", f->stream, "Stream name (default: the source's)")
            ->type_name("NAME")
            ->check(stream_name());
        app.add_option("--domain", f->domain, "DDS domain (default 0)")->check(CLI::Range(0, 230));
        app.add_option("--interface", f->interface,
                       "Network interface, by name or address (default: the first that reaches others; lo "
                       "for this machine alone)")
            ->type_name("NAME");
        app.add_option("--keys", f->keys,
                       "Folder of the keys that secure the stream; none for a plain one (default: "
                       "$RELIEVO_KEYS, ~/.config/relievo/keys or /etc/relievo/keys, where there are some)")
            ->type_name("DIR");
        app.add_option("--web", f->web,
                       "Where browsers find the viewer; :PORT for every interface, none for no viewer "
                       "(default 127.0.0.1:8080)")
            ->type_name("HOST:PORT")
            ->check(listen_address(true));
        f->gateway = add_web_flags(app);
        app.add_option("--record", f->record, "Record the stream into this new .mcap file")
            ->type_name("FILE");
        f->recording = add_recording_flags(app);
        app.add_option("--record-dir", f->record_folder,
                       "Folder of recordings that are started and stopped over the web API (docs/WEB.md), by "
                       "the viewer or a program; made where only its last name is new")
            ->type_name("DIR");
        app.add_option(
               "--pre-roll", f->pre_roll,
               "They begin with so much of what came before, e.g. 10s, 256 MB at most (default 0: from "
               "the last key frame on)")
            ->type_name("TIME")
            ->check(pre_roll());
        app.add_option("--projector", f->projector,
                       "Output of this machine that the page /rig may show the pattern on, as in `project "
                       "--list`; auto for the only, or the second one (default: pages drive no projector)")
            ->type_name("NAME");
        app.add_option("--refreshes", f->refreshes, "With --projector: refreshes that each picture stays")
            ->check(CLI::Range(1, kMostRefreshes));
        add_size_option(app, "--projector-size", f->projector_size,
                        "With --projector: its mode, for a rig that the page /rig is to calibrate from "
                        "nothing; afterwards rig.yaml says it");
        app.add_option("--frames", f->frames, "End after this many camera frames")->check(whole_number(1));
        app.add_option(
               "--decoder", f->decoder,
               "ordered (the most exact; default with --fast or --half-lines), quick (for a camera that "
               "ordered cannot keep up with), auto (default: as exact as all of the camera's frames can "
               "be on this machine: ordered, quick, or quick with fewer lines) or paper (as published)")
            ->check(CLI::IsMember(kServedDecoders))
            ->type_name("NAME");
        add_switch(app, "--half-lines", f->half_lines, kHalfLinesHelp);
        add_switch(app, "--dense", f->dense,
                   "A vertex at each pixel of a line, interpolated between boundaries of one surface");
        app.add_option("--fill-holes", f->fill_holes,
                       "Bridge so many missing boundaries or lines of one surface (default 0: none)")
            ->check(CLI::Range(0, kMostFilled))
            ->type_name("N");
        app.add_option("--threads", f->threads,
                       "Threads that reconstruct (default: half of the cores, 1 to 8)")
            ->check(CLI::Range(1, 64));
        app.add_option("--texture", f->texture,
                       "How the texture is sent: jpeg (default: any receiver), webp (smaller, slower), png "
                       "(lossless) or "
                       "h264 (smallest; browsers show it on https and localhost alone)")
            ->check([](const std::string& name) {
              return texture_codec_named(name) ? "" : "give " + texture_codec_names();
            })
            ->type_name("NAME");
        app.add_option(
               "--texture-encoder", f->texture_encoder,
               "Which encoder makes h264: auto (default: the hardware's where one opens, else x264), x264, "
               "nvenc, vaapi or v4l2m2m")
            ->check([](const std::string& name) {
              return video_encoder_named(name) ? "" : "give " + video_encoder_names();
            })
            ->type_name("NAME");
        app.add_option("--texture-quality", f->texture_quality,
                       "1 to 100, of png without effect (default 80: 37 to 40 dB)")
            ->check(CLI::Range(1, 100))
            ->type_name("N");
        app.add_option("--bitrate", f->bit_rate,
                       "Keep the stream at so many bits a second at most, such as 4M: texture quality, steps "
                       "of grid, standard deviations and lines become coarser than asked for where it needs "
                       "that, and fine again")
            ->type_name("BITS")
            ->check(bit_rate());
        app.add_option("--deadline", f->deadline_ms,
                       "Keep the time from a frame's surface to its being published below so many "
                       "milliseconds, in the same way")
            ->type_name("MS")
            ->check(number(kLeastDeadline_ms, kMostDeadline_ms));
        app.add_option("--psnr", f->texture_db,
                       "Keep the texture this good, decibels: no finer than that needs, as fine as "
                       "--texture-quality (then 95 unless given). --bitrate and --deadline go before it")
            ->type_name("DB")
            ->check(number(kLeastTexture_db, kMostTexture_db));
        app.add_option(
               "--geometry", f->geometry,
               "How the surface is sent: grid (default: as measured, for relievo's own receivers), "
               "metric (the same estimated from all frames so far: smaller and exacter), visual (the "
               "smallest, within --bound), draco-grid (as grid, in Draco's point clouds) or draco-mesh "
               "(for any receiver)")
            ->check([](const std::string& name) {
              EncodeOptions unused;
              return set_geometry_profile(name, unused) ? "" : "give " + geometry_profile_names();
            })
            ->type_name("NAME");
        app.add_option("--step-bits", f->step_bits,
                       "Of grid, metric and draco-grid: columns are sent in steps of 1/2^bits pixel (default "
                       "6: 1/64)")
            ->check(CLI::Range(0, 8))
            ->type_name("N");
        app.add_option("--bound", f->bound_px,
                       "Of visual: how far a vertex may be off in the camera's picture, pixels (default 0.5)")
            ->check(number(kLeastBound_px, kMostBound_px))
            ->type_name("PX");
        app.add_option("--key-interval", f->key_interval,
                       "Of grids and h264: every Nth frame decodes alone, the others need frames before "
                       "(default 1: all do; with "
                       "metric, visual or h264 30)")
            ->check(CLI::Range(1, 1000))
            ->type_name("N");
        app.add_option("--draco-speed", f->draco_speed, "Of draco-mesh: 0 smallest, 9 fastest (default 4)")
            ->check(CLI::Range(0, 9));
        app.add_option(
               "--ladder", f->ladder,
               "Lower qualities to be had of the stream, made while somebody reads them: reduced (every "
               "second line, half the texture's size), texture (that texture alone), slow (likewise, a frame "
               "at a "
               "time as the way to its readers has room) or none (default reduced,texture,slow)")
            ->check([](const std::string& names) {
              const auto rungs = parse_ladder(names);
              return rungs ? std::string() : rungs.error().message;
            })
            ->type_name("NAMES");
        add_switch(app, "--loop", f->loop, "Start a take again at its end");
        add_switch(app, "--fast", f->fast, "No pacing, nothing dropped: as fast as the machine allows");
        add_rig_flags(app, f->camera);
        add_camera_flags(app, f->camera);
        app.final_callback([f] {
          StreamConfig given;
          set_stream(*f, given);
          if (const Status lines = check_lines(given); !lines)
            throw CLI::ValidationError("--half-lines", lines.error().message);
          // What there is to be split may be in the file.
          const auto kept = recording_options(*f->recording);
          if (!f->config && !kept) throw CLI::ValidationError(kept.error().message);
        });
        app.footer(
            "Examples:\n"
            "  relievo-server serve                                        the simulated face\n"
            "  relievo-server serve --source take:TAKE --loop --web :8080  a take, for other machines too\n"
            "  relievo-server serve --web :8443 --tls-cert rig.pem --tls-key rig.key --token-file tokens\n"
            "  relievo-server serve --source sim:walk,drop=50 --record walk.mcap\n"
            "  relievo-server serve --record-dir takes --pre-roll 10s\n"
            "  relievo-server serve --config /etc/relievo/server.toml\n"
            "  relievo-server serve --source sim:walk --texture h264 --bitrate 4M --deadline 12\n"
            "  relievo-server serve --source v4l2:/dev/video0 --rig rig.yaml --control gain=20\n\n" +
            std::string(scheme_help()));
        return [f](StopSignal& stop) { return run(*f, stop); };
      }};
}

}  // namespace relievo
