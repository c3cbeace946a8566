// SPDX-License-Identifier: Apache-2.0
// The whole chain in one process, at the camera's pace: pipeline, DDS publisher and gateway, and their
// readers.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <thread>
#include <utility>

#include "base/time.h"
#include "bench/chain_clients.h"
#include "bench/frames.h"
#include "bench/options.h"
#include "bench/report.h"
#include "bench/suites.h"
#include "bench/usage.h"
#include "cli/checks.h"
#include "codec/texture_codec.h"
#include "idl/transport.h"
#include "server/config.h"
#include "server/options.h"
#include "server/pipeline.h"
#include "server/sinks.h"
#include "web/gateway/gateway.h"
#include "web/gateway/key_frame_wishes.h"

namespace relievo::bench {
namespace {

constexpr int kDistinctFrames = 80;
constexpr std::uint64_t kWarmUp = 15;    // published frames that do not count, a quarter of the run at most
constexpr std::size_t kRateWindow = 30;  // frames that a rate is measured over
constexpr std::uint64_t kSerialFrames = 32;
constexpr int kPatience_ms = 5000;  // for readers to be found, and for the last frames to arrive
const std::string kStream = "bench";

struct Options {
  std::string source = "sim:face";
  int clients = 1;
  int web_clients = 1;
  double seconds = 10;
  std::uint64_t frames = 0;  // 0: as many as `seconds` take
  DomainOptions domain{.domain = 1 + static_cast<int>(getpid() % 200), .interface = ""};
  int threads = 1;
  int line_stride = 1;
  std::string decoder{decoder_name(ReconstructOptions{}.decoder)};  // as `serve` has it
  std::string geometry = "grid", texture = "jpeg";
  bool json = false;
};

/// As `serve` makes of them.
StreamConfig served_as(const Options& options) {
  StreamConfig config;
  set_decoder(options.decoder, config);
  config.half_lines = options.line_stride > 1;
  config.geometry = options.geometry;
  config.texture = texture_codec_named(options.texture).value_or(config.texture);
  return config;
}

/// What frames are decoded with, first.
ReconstructOptions reconstruct_options(const Options& options) {
  return {.decoder = served_decoder(served_as(options)).decoder,
          .threads = options.threads,
          .line_stride = options.line_stride};
}

EncodeOptions coded_as(const Options& options) {
  return encode_options(served_as(options));
}

/// The reference: the same frames through the same stages on one thread, nothing waiting for anything. No
/// latency can be less.
struct Serial {
  std::vector<double> reconstruct_ms, encode_ms, geometry_ms, texture_ms, decode_ms, total_ms, bytes;
};

Result<Serial> run_serially(const FrameLoop& frames, const Options& options, StopSignal& stop) {
  FrameEncoder encoder(frames.info().rig, frames.info().pattern, options.line_stride);
  FrameDecoder decoder;
  Frame3D decoded;
  const EncodeOptions encode = coded_as(options);
  Serial serial;
  auto reconstructor =
      Reconstructor::create(frames.info().rig, frames.info().pattern, reconstruct_options(options));
  if (!reconstructor) return reconstructor.error();
  const std::uint64_t count = options.frames > 0 ? std::min(options.frames, kSerialFrames) : kSerialFrames;
  for (std::uint64_t n = 0; n < count + 4 && !stop.stopped(); ++n) {
    const std::int64_t begin = steady_now_ns();
    auto frame = reconstructor->add(frames.at(n));
    const std::int64_t reconstructed = steady_now_ns();
    if (!frame) return frame.error();
    if (!*frame) continue;
    std::int64_t surface_coded = reconstructed;
    const auto bytes = encoder.encode(**frame, encode, [&] { surface_coded = steady_now_ns(); });
    const std::int64_t encoded = steady_now_ns();
    if (!bytes) return bytes.error();
    const Status done = decoder.decode(*bytes, decoded);
    const std::int64_t end = steady_now_ns();
    if (!done) return done.error();
    reconstructor->recycle(*std::move(*frame));  // as the pipeline does
    if (n < 4) continue;                         // memory is being allocated
    serial.reconstruct_ms.push_back(milliseconds(reconstructed - begin));
    serial.encode_ms.push_back(milliseconds(encoded - reconstructed));
    serial.geometry_ms.push_back(milliseconds(surface_coded - reconstructed));
    serial.texture_ms.push_back(milliseconds(encoded - surface_coded));
    serial.decode_ms.push_back(milliseconds(end - encoded));
    serial.total_ms.push_back(milliseconds(end - begin));
    serial.bytes.push_back(static_cast<double>(bytes->size()));
  }
  return serial;
}

/// Notes what is published; before the other sinks, so that their time does not count.
class NotingSink final : public FrameSink {
 public:
  Status consume(const FrameMessage& frame) override {
    published_.push_back({frame.sequence, frame.publish_time_ns,
                          milliseconds(frame.publish_time_ns - frame.capture_time_ns), 0});
    return {};
  }
  Status consume(const ServerStatus&) override { return {}; }
  const std::vector<Seen>& published() const { return published_; }

 private:
  std::vector<Seen> published_;
};

/// What is measured of frames seen at one place, those of the warm-up left out.
struct Trace {
  std::vector<double> latency_ms, decode_ms, frames_per_s;

  void add(const std::vector<Seen>& seen, std::uint64_t warm_up) {
    std::vector<std::int64_t> times;
    for (const Seen& s : seen) {
      if (s.sequence < warm_up) continue;
      latency_ms.push_back(s.latency_ms);
      decode_ms.push_back(s.decode_ms);
      times.push_back(s.time_ns);
    }
    if (times.size() < 2) return;
    const std::size_t window = std::min(kRateWindow, times.size() - 1);
    for (std::size_t i = 0; i + window < times.size(); ++i)
      frames_per_s.push_back(static_cast<double>(window) / seconds(times[i + window] - times[i]));
  }
};

struct Outcome {
  ServerStatus status;
  std::uint64_t warm_up = 0;
  Trace published, decoded, web;
  std::uint64_t lost_dds = 0, lost_web = 0;
  Usage usage;
  double resident_before_mb = 0;
};

using Clients = std::vector<std::unique_ptr<ChainClient>>;

/// A pipeline gives the key frames that are wished for, while this is there.
class AnswersWishes {
 public:
  AnswersWishes(KeyFrameWishes& wishes, Pipeline& pipeline) : wishes_(wishes) {
    wishes_.answer_with([&pipeline](const std::string&) { pipeline.request_key_frame(); });
  }
  AnswersWishes(const AnswersWishes&) = delete;
  AnswersWishes& operator=(const AnswersWishes&) = delete;
  ~AnswersWishes() { wishes_.answer_with({}); }

 private:
  KeyFrameWishes& wishes_;
};

template <typename Condition>
void wait_for(const Condition& condition) {
  for (int waited = 0; waited < kPatience_ms && !condition(); waited += 10)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

Result<Outcome> run_chain(const FrameLoop& frames, const Options& options, StopSignal& stop) {
  Outcome out;
  out.resident_before_mb = resident_mb();
  const StreamInfo info{.stream = kStream,
                        .source = options.source,
                        .started_ns = utc_now_ns(),
                        .rig = frames.info().rig,
                        .pattern = frames.info().pattern};
  KeyFrameWishes wishes;  // outlives who wishes
  auto gateway =
      Gateway::start({.port = 0, .key_frame_wanted = [&](const std::string& name) { wishes.wish(name); }});
  if (!gateway) return gateway.error();
  auto publisher = Publisher::create(options.domain, info, [&] { wishes.wish(kStream); });
  if (!publisher) return publisher.error();
  (*gateway)->announce(info);

  const auto source = frames.play();
  NotingSink noting;
  const auto dds = make_dds_sink(**publisher);
  const auto web = make_gateway_sink(**gateway, kStream);
  const double rate = frames.info().rig.frame_rate;
  PipelineOptions pipeline_options;
  pipeline_options.stream = kStream;
  pipeline_options.frames =
      options.frames > 0 ? options.frames : static_cast<std::uint64_t>(std::ceil(options.seconds * rate));
  pipeline_options.reconstruct = reconstruct_options(options);
  pipeline_options.auto_pace = served_decoder(served_as(options)).auto_pace;
  pipeline_options.encode = coded_as(options);
  auto pipeline = Pipeline::create(*source, {&noting, dds.get(), web.get()}, pipeline_options);
  if (!pipeline) return pipeline.error();
  const AnswersWishes answers(wishes, **pipeline);

  Clients dds_clients, web_clients;  // after what they read from: they end first
  for (int i = 0; i < options.clients; ++i) {
    auto client = make_dds_client(options.domain, kStream);
    if (!client) return client.error();
    dds_clients.push_back(*std::move(client));
  }
  for (int i = 0; i < options.web_clients; ++i) {
    auto client = make_web_client((*gateway)->port(), kStream);
    if (!client) return client.error();
    web_clients.push_back(*std::move(client));
  }
  wait_for([&] { return (*publisher)->matched_readers() >= options.clients; });

  const auto all = [&](const auto& each) {
    for (Clients* clients : {&dds_clients, &web_clients})
      for (const auto& client : *clients) each(*client);
  };
  UsageMeter meter([&] {
    std::int64_t sum = 0;
    all([&](const ChainClient& client) { sum += client.cpu_ns(); });
    return sum;
  });
  stop.on_stop([&] { (*pipeline)->stop(); });
  const Status done = (*pipeline)->run();
  stop.clear_on_stop();
  out.usage = meter.finish();
  if (!done) return done.error();
  out.status = (*pipeline)->status();
  wait_for([&] {
    bool complete = true;
    all([&](const ChainClient& client) { complete &= client.accounted() >= out.status.frames_published; });
    return complete;
  });
  all([](ChainClient& client) { client.finish(); });

  out.warm_up = std::min(kWarmUp, out.status.frames_published / 4);
  out.published.add(noting.published(), out.warm_up);
  for (const auto& client : dds_clients) {
    if (const Status ok = client->status(); !ok) return ok.error();
    out.decoded.add(client->seen(), out.warm_up);
    // Counted against what was published, so that frames lost before the first that came count too.
    out.lost_dds += out.status.frames_published - client->seen().size();
  }
  for (const auto& client : web_clients) {
    if (const Status ok = client->status(); !ok) return ok.error();
    out.web.add(client->seen(), out.warm_up);
    out.lost_web += out.status.frames_published - client->seen().size();
  }
  return out;
}

/// Processor time of a frame by the threads that it goes through, milliseconds.
std::vector<Figure> times_by_thread(const Outcome& o, double source_rate) {
  struct Part {
    const char* name;
    std::vector<std::string> threads;
  };
  const Part parts[] = {{"reconstruct", {"reconstruct", "worker"}},
                        {"encode", {"encode"}},
                        {"publish", {"publish"}},
                        {"gateway", {"gateway"}},
                        {"dds_clients", {"subscriber"}},
                        {"web_clients", {"web client"}}};
  std::map<std::string, double> cores = o.usage.thread_cores;
  const double rate = spread_of(o.published.frames_per_s).median;
  std::vector<Figure> out{{"cpu_ms.capture", cores["relievo-bench"] / source_rate * 1e3}};
  cores.erase("relievo-bench");
  for (const Part& part : parts) {
    double sum = 0;
    for (const std::string& thread : part.threads) sum += std::exchange(cores[thread], 0);
    out.push_back({std::string("cpu_ms.") + part.name, sum / rate * 1e3});
  }
  double rest = 0;
  for (const auto& [name, of] : cores) rest += of;
  out.push_back({"cpu_ms.rest", rest / rate * 1e3});
  return out;
}

Report report_of(const Options& options, const FrameLoop& frames, const Serial& serial, const Outcome& o) {
  const auto count = [](auto n) { return static_cast<double>(n); };
  Report report{
      .suite = "chain",
      .settings = {{"source", options.source},
                   {"clients", count(options.clients)},
                   {"web_clients", count(options.web_clients)},
                   {"threads", count(options.threads)},
                   {"decoder", options.decoder},
                   {"line_stride", count(options.line_stride)},
                   {"geometry", options.geometry},
                   {"texture", options.texture},
                   {"domain", count(options.domain.domain)},
                   {"distinct_frames", count(frames.size())},
                   {"warm_up_frames", count(o.warm_up)}},
      .figures = {{"frames.captured", count(o.status.frames_captured)},
                  {"frames.published", count(o.status.frames_published)},
                  {"frames_per_s.source", frames.info().rig.frame_rate},
                  {"frames_per_s.published", spread_of(o.published.frames_per_s)},
                  {"frames_per_s.decoded", spread_of(o.decoded.frames_per_s)},
                  {"frames_per_s.web", spread_of(o.web.frames_per_s)},
                  {"latency_ms.capture_to_publish", spread_of(o.published.latency_ms)},
                  {"latency_ms.capture_to_decoded", spread_of(o.decoded.latency_ms)},
                  {"latency_ms.capture_to_web", spread_of(o.web.latency_ms)},
                  {"latency_ms.decode", spread_of(o.decoded.decode_ms)},
                  {"serial_ms.reconstruct", spread_of(serial.reconstruct_ms)},
                  {"serial_ms.encode", spread_of(serial.encode_ms)},
                  {"serial_ms.encode_geometry", spread_of(serial.geometry_ms)},
                  {"serial_ms.encode_texture", spread_of(serial.texture_ms)},
                  {"serial_ms.decode", spread_of(serial.decode_ms)},
                  {"serial_ms.total", spread_of(serial.total_ms)},
                  {"frame_bytes", spread_of(serial.bytes)},
                  {"cpu_cores.server", spread_of(o.usage.server_cores)},
                  {"cpu_cores.clients", spread_of(o.usage.client_cores)},
                  {"cpu_cores.total", spread_of(o.usage.total_cores)},
                  {"memory_mb.resident", spread_of(o.usage.resident_mb)},
                  {"memory_mb.before", o.resident_before_mb},
                  {"drops.capture", count(o.status.drops_capture)},
                  {"drops.reconstruct", count(o.status.drops_reconstruct)},
                  {"drops.encode", count(o.status.drops_encode)},
                  {"drops.publish", count(o.status.drops_publish)},
                  {"drops.dds", count(o.lost_dds)},
                  {"drops.web", count(o.lost_web)}},
      .notes = {
          "Capture is when the whole frame is there: exposure and readout come on top. DDS readers are in "
          "the same\n"
          "process, so the network is not in the figures; WebSocket clients come by TCP and do not decode.\n"
          "Reference: serial_ms, the same frames through the same stages on one thread; memory_mb.before, "
          "which\n"
          "holds the camera's frames. drops.dds and drops.web are sums over the clients. cpu_ms: processor "
          "time of a captured frame, and of a "
          "published one.\n"
          "rest: DDS's own threads."}};
  const std::vector<Figure> times = times_by_thread(o, frames.info().rig.frame_rate);
  report.figures.insert(report.figures.end(), times.begin(), times.end());
  return report;
}

Status run(const Options& options, StopSignal& stop) {
  if (const Status fits = check_lines(served_as(options)); !fits) return fits;
  const auto loop = FrameLoop::load(options.source, kDistinctFrames, stop);
  if (!loop) return loop.error();
  if (!*loop) return {};
  const auto serial = run_serially(**loop, options, stop);
  if (!serial) return serial.error();
  if (stop.stopped()) return {};
  const auto outcome = run_chain(**loop, options, stop);
  if (!outcome) return outcome.error();
  // A run cut short is one all the same.
  if (outcome->status.frames_published == 0 && stop.stopped()) return {};
  if (outcome->status.frames_published == 0) return Error{"no frame was published: run more --frames"};
  print(report_of(options, **loop, *serial, *outcome), options.json);
  return {};
}

}  // namespace

Command chain_suite() {
  return {"chain", "The whole chain at the camera's pace: rate, latency, processor, memory, drops",
          [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            add_source_option(app, options->source);
            app.add_option("--clients", options->clients, "DDS readers that decode")
                ->check(CLI::Range(0, 64))
                ->capture_default_str();
            app.add_option("--web-clients", options->web_clients, "WebSocket clients")
                ->check(CLI::Range(0, 64))
                ->capture_default_str();
            app.add_option("--seconds", options->seconds, "How long")
                ->check(number(0.1, 86400))
                ->capture_default_str();
            app.add_option("--frames", options->frames, "Camera frames, instead of --seconds")
                ->check(whole_number(1, 1'000'000));
            app.add_option("--domain", options->domain.domain, "DDS domain (default: one of its own)")
                ->check(CLI::Range(0, 230));
            app.add_option("--interface", options->domain.interface,
                           "Network interface, by name or address (default: the first that reaches others)")
                ->type_name("NAME");
            add_threads_option(app, options->threads);
            app.add_option("--decoder", options->decoder, "ordered, quick, auto or paper, as `serve` has it")
                ->check(CLI::IsMember(kServedDecoders))
                ->capture_default_str();
            add_half_lines_option(app, options->line_stride);
            add_codec_options(app, options->geometry, options->texture);
            add_json_option(app, options->json);
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo::bench
