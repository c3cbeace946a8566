// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "base/log.h"
#include "base/time.h"
#include "capture/source/field_source.h"
#include "cli/checks.h"
#include "cli/listen_address.h"
#include "cli/quantities.h"
#include "cli/service_manager.h"
#include "cli/web_flags.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"
#include "idl/cdr.h"
#include "idl/recorder.h"
#include "idl/transport.h"
#include "server/camera_flags.h"
#include "server/commands.h"
#include "server/config.h"
#include "server/options.h"
#include "server/pipeline.h"
#include "server/sinks.h"
#include "web/gateway/gateway.h"
#include "web/gateway/key_frame_wishes.h"

namespace relievo {
namespace {

/// "take:../shared/takes/bunny" -> "bunny", "sim:face,stripes=70" -> "face".
std::string stream_name_of(const std::string& source) {
  std::string name = source.substr(source.find(':') + 1);
  name = name.substr(0, name.find(','));
  while (!name.empty() && name.back() == '/') name.pop_back();
  name = std::filesystem::path(name).stem().string();
  for (char& c : name) {
    if (!valid_stream_name(std::string(1, c)) && c != '.') c = '_';
  }
  return valid_stream_name(name) ? name : "stream";
}

DomainOptions domain_options(const ServeConfig& config) {
  return {.domain = config.domain, .interface = config.interface, .keys = config.keys};
}

void say_drops(const ServerStatus& s) {
  log_info(std::to_string(s.frames_captured) + " frames captured, " + std::to_string(s.frames_published) +
           " published; dropped: " + std::to_string(s.drops_capture) + " in capture, " +
           std::to_string(s.drops_reconstruct) + " before reconstruction, " + std::to_string(s.drops_encode) +
           " before encoding, " + std::to_string(s.drops_publish) + " before publishing");
}

void say_camera(const SourceCounts& c) {
  if (c.damaged_pictures + c.restarts + c.reconnects == 0) return;
  log_info("camera: " + std::to_string(c.damaged_pictures) + " damaged pictures, " +
           std::to_string(c.restarts) + " restarts of its driver, unplugged " + std::to_string(c.reconnects) +
           " times");
}

/// The server's own recorder: a reader of the stream like any other.
struct Recording {
  std::optional<Recorder> recorder;
  std::unique_ptr<Subscriber> subscriber;

  Status start(const ServeConfig& config, const std::string& stream, const Publisher& publisher) {
    const auto options = recording_options(config.recording);
    if (!options) return options.error();
    // The recorder makes the file with the first sample; that it cannot should be said before.
    if (const Status target = check_recording_target(config.record, options->segments.split()); !target)
      return target;
    recorder.emplace(Recorder::Options{.file = config.record, .stream = stream, .recording = *options});
    auto created = Subscriber::create(domain_options(config), stream, recorder->callbacks());
    if (!created) return created.error();
    subscriber = *std::move(created);
    // The first frame should be in the file: wait until reader and writer have found each other.
    for (int tries = 0; tries < 200 && publisher.matched_readers() == 0; ++tries) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return {};
  }

  /// After the last frame was published.
  Status finish(std::uint64_t published) {
    if (!recorder) return {};
    for (int tries = 0; tries < 100 && !recorder->done(); ++tries) {
      const Recorder::Counts counts = recorder->counts();
      if (counts.frames + counts.lost >= published) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    subscriber.reset();
    const Status done = recorder->finish();
    const Recorder::Counts counts = recorder->counts();
    if (!done)
      return done.error().in("the recording stopped after " + std::to_string(counts.frames) +
                             " frames; the " + std::to_string(counts.missed) + " after them are not in it");
    log_info("recorded " + std::to_string(counts.frames) + " frames, " + std::to_string(counts.lost) +
             " lost" + (counts.files > 1 ? ", in " + std::to_string(counts.files) + " files" : ""));
    return {};
  }
};

Status serve(const ServeConfig& config, StopSignal& stop) {
  StreamInfo info;
  info.stream = config.stream.empty() ? stream_name_of(config.source) : config.stream;
  if (!valid_stream_name(info.stream)) {
    return Error{"'" + info.stream +
                 "' cannot name a stream: use up to 64 letters, digits, '_', '-' and '.'"};
  }
  if (const Status usable = check_texture_codec(config.texture); !usable) return usable.error();
  if (const Status sound = check_web_options(config.gateway); !sound) return sound.error();
  std::optional<ListenAddress> web;
  if (config.web != "none") {
    auto address = parse_listen_address(config.web);
    if (!address) return address.error();
    web = *std::move(address);
  }

  KeyFrameWishes wishes;  // of DDS readers and browsers; outlives both
  // The gateway first: a port in use should fail before anything is opened or announced.
  std::unique_ptr<Gateway> gateway;
  if (web) {
    auto started = Gateway::start(
        {.host = web->host,
         .port = web->port,
         .web = config.gateway,
         .key_frame_wanted = [&](const std::string& name) { wishes.wish(name); },
         .samples = SampleFormat{.type_name = topic_type(Topic::kFrame).type_name,
                                 .idl = topic_type(Topic::kFrame).idl,
                                 .encode = [](const std::string& name, const FrameMessage& frame) {
                                   return write_frame_cdr(name, frame);
                                 }}});
    if (!started) return started.error();
    gateway = *std::move(started);
  }
  const auto name = with_scheme(config.source, config.scheme);
  if (!name) return name.error();
  if (const Status known = check_rig(config.source, config.camera); !known) return known;
  auto source =
      open_source(*name, {.loop = config.loop || config.source.starts_with("sim:"), .camera = config.camera});
  if (!source) return source.error();
  info.source = *name;
  info.started_ns = utc_now_ns();
  info.rig = (*source)->info().rig;
  info.pattern = (*source)->info().pattern;
  auto publisher = Publisher::create(domain_options(config), info, [&] { wishes.wish(info.stream); });
  if (!publisher) return publisher.error();
  Recording recording;
  if (!config.record.empty()) {
    if (const Status started = recording.start(config, info.stream, **publisher); !started)
      return started.error();
  }

  std::vector<std::unique_ptr<FrameSink>> owned;
  owned.push_back(make_dds_sink(**publisher));
  if (gateway) {
    gateway->announce(info);
    owned.push_back(make_gateway_sink(*gateway, info.stream));
  }
  if (recording.recorder) owned.push_back(make_recorder_sink(*recording.recorder));
  owned.push_back(make_service_sink());
  std::vector<FrameSink*> sinks;
  for (const auto& sink : owned) sinks.push_back(sink.get());

  PipelineOptions options;
  options.stream = info.stream;
  options.paced = !config.fast;
  options.lossless = config.fast;
  options.frames = config.frames;
  options.reconstruct.threads = config.threads;
  options.reconstruct.decoder = config.decoder;
  options.reconstruct.surface = config.surface;
  options.encode = encode_options(config);
  options.bit_rate = config.bit_rate;
  auto pipeline = Pipeline::create(**source, sinks, options);
  if (!pipeline) return pipeline.error();

  std::printf("stream %s on DDS domain %d\n", info.stream.c_str(), config.domain);
  if (gateway)
    std::printf("viewer %s\n", browser_address({web->host, gateway->port()}, !config.gateway.tls_cert.empty(),
                                               gateway->made_token())
                                   .c_str());
  std::fflush(stdout);  // whoever waits for the address reads a pipe

  tell_ready();
  stop.on_stop([&] {
    tell_stopping();
    (*pipeline)->stop();
  });
  wishes.answer_with([&](const std::string&) { (*pipeline)->request_key_frame(); });
  const Status done = (*pipeline)->run();
  wishes.answer_with({});
  stop.clear_on_stop();
  if (gateway) gateway->withdraw(info.stream);
  say_drops((*pipeline)->status());
  say_camera((*source)->counts());
  const Status recorded = recording.finish((*pipeline)->status().frames_published);
  if (!done || !recorded || stop.stopped()) return done ? recorded : done;
  if (const ServerStatus ended = (*pipeline)->status(); ended.frames_published == 0) {
    return Error{
        config.source + " ended before a frame could be published: " +
        (ended.message.empty() ? "a surface needs two frames under different slides" : ended.message)};
  }
  return {};
}

std::string stream_name(const std::string& name) {
  return valid_stream_name(name)
             ? ""
             : "'" + name + "' cannot name a stream: use up to 64 letters, digits, '_', '-' and '.'";
}

/// Flags as given; what is not given leaves the file's or the default value.
struct Flags {
  std::optional<std::string> config, source, stream, interface, keys, web, record;
  std::optional<std::string> decoder, geometry, texture, bit_rate;
  std::string scheme;
  std::shared_ptr<RecordingTexts> recording;
  std::shared_ptr<WebOptions> gateway;
  std::optional<int> domain, threads, texture_quality, draco_speed, step_bits, key_interval, fill_holes;
  std::optional<double> bound_px;
  std::optional<std::uint64_t> frames;
  bool loop = false, fast = false, dense = false;
  CameraOptions camera;
};

Status run(const Flags& flags, StopSignal& stop) {
  ServeConfig config;
  if (flags.config) {
    if (const Status read = read_config(*flags.config, config); !read) return read.error();
  }
  const auto set = [](const auto& flag, auto& field) {
    if (flag) field = *flag;
  };
  set(flags.source, config.source);
  set(flags.stream, config.stream);
  set(flags.interface, config.interface);
  set(flags.keys, config.keys);
  set(flags.web, config.web);
  set(flags.record, config.record);
  config.recording = merged(*flags.recording, std::move(config.recording));
  config.gateway = merged(*flags.gateway, std::move(config.gateway));
  set(flags.domain, config.domain);
  set(flags.threads, config.threads);
  if (!flags.scheme.empty()) config.scheme = flags.scheme;
  if (flags.decoder) config.decoder = *flags.decoder == "paper" ? Decoder::kPaper : Decoder::kOrdered;
  if (flags.texture) config.texture = texture_codec_named(*flags.texture).value_or(config.texture);
  set(flags.texture_quality, config.texture_quality);
  if (flags.bit_rate) config.bit_rate = parse_bit_rate(*flags.bit_rate).value();  // the option is checked
  set(flags.geometry, config.geometry);
  set(flags.step_bits, config.step_bits);
  set(flags.key_interval, config.key_interval);
  set(flags.bound_px, config.bound_px);
  set(flags.draco_speed, config.draco_speed);
  set(flags.fill_holes, config.surface.fill_holes);
  config.surface.dense = config.surface.dense || flags.dense;
  if (flags.frames) config.frames = flags.frames;
  config.loop = config.loop || flags.loop;
  config.fast = config.fast || flags.fast;
  config.camera = merged(std::move(config.camera), flags.camera);
  return serve(config, stop);
}

}  // namespace

Command serve_command() {
  return {
      "serve", "Capture, reconstruct and stream", [](CLI::App& app) {
        auto f = std::make_shared<Flags>();
        app.add_option("--config", f->config, "TOML file with these settings; flags win")->type_name("FILE");
        app.add_option(
               "--source", f->source,
               "sim:SCENE[,KEY=VALUE...] (simulate --help lists them), take:DIR or v4l2:DEVICE (default "
               "sim:face)")
            ->type_name("SOURCE");
        add_scheme_option(app, f->scheme);
        app.add_option("--stream", f->stream, "Stream name (default: the source's)")
            ->type_name("NAME")
            ->check(stream_name);
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
        app.add_option("--frames", f->frames, "End after this many camera frames")->check(whole_number(1));
        app.add_option("--decoder", f->decoder,
                       "ordered (default: more exact) or paper (as published: three times as fast)")
            ->check(CLI::IsMember({"ordered", "paper"}))
            ->type_name("NAME");
        app.add_flag("--dense", f->dense,
                     "A vertex at each pixel of a line, interpolated between boundaries of one surface");
        app.add_option("--fill-holes", f->fill_holes,
                       "Bridge so many missing boundaries or lines of one surface (default 0: none)")
            ->check(CLI::Range(0, kMostFilled))
            ->type_name("N");
        app.add_option("--threads", f->threads, "Threads that reconstruct (default 1)")
            ->check(CLI::Range(1, 64));
        app.add_option("--texture", f->texture,
                       "How the texture is sent: jpeg (default: any receiver), webp (smaller, slower), png "
                       "(lossless) or "
                       "h264 (smallest; browsers show it on https and localhost alone)")
            ->check([](const std::string& name) {
              return texture_codec_named(name) ? "" : "give " + texture_codec_names();
            })
            ->type_name("NAME");
        app.add_option("--texture-quality", f->texture_quality,
                       "1 to 100, of png without effect (default 80: 37 to 40 dB)")
            ->check(CLI::Range(1, 100))
            ->type_name("N");
        app.add_option("--bitrate", f->bit_rate,
                       "Keep the stream below so many bits a second, such as 4M: texture quality and steps "
                       "of grid become "
                       "coarser than asked for where it needs that, and fine again")
            ->type_name("BITS")
            ->check(bit_rate());
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
        app.add_option(
               "--step-bits", f->step_bits,
               "Of grid, metric and draco-grid: columns are sent in steps of 1/2^N pixel (default 6: 1/64)")
            ->check(CLI::Range(0, 8))
            ->type_name("N");
        app.add_option("--bound", f->bound_px,
                       "Of visual: how far a vertex may be off in the camera's picture, pixels (default 0.5)")
            ->check(CLI::Range(kLeastBound_px, kMostBound_px))
            ->type_name("PX");
        app.add_option("--key-interval", f->key_interval,
                       "Of grids and h264: every Nth frame decodes alone, the others need frames before "
                       "(default 1: all do; with "
                       "metric, visual or h264 30)")
            ->check(CLI::Range(1, 1000))
            ->type_name("N");
        app.add_option("--draco-speed", f->draco_speed, "Of draco-mesh: 0 smallest, 9 fastest (default 4)")
            ->check(CLI::Range(0, 9));
        app.add_flag("--loop", f->loop, "Start a take again at its end");
        app.add_flag("--fast", f->fast, "No pacing, nothing dropped: as fast as the machine allows");
        add_rig_flags(app, f->camera);
        add_camera_flags(app, f->camera);
        app.footer(
            "Examples:\n"
            "  relievo-server serve                                        the simulated face\n"
            "  relievo-server serve --source take:TAKE --loop --web :8080  a take, for other machines too\n"
            "  relievo-server serve --web :8443 --tls-cert rig.pem --tls-key rig.key --token-file tokens\n"
            "  relievo-server serve --source sim:walk,drop=50 --record walk.mcap\n"
            "  relievo-server serve --source sim:walk --texture h264 --bitrate 4M\n"
            "  relievo-server serve --source v4l2:/dev/video0 --rig rig.yaml --control gain=20\n\n" +
            std::string(scheme_help()));
        return [f](StopSignal& stop) { return run(*f, stop); };
      }};
}

}  // namespace relievo
