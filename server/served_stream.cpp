// SPDX-License-Identifier: Apache-2.0
#include "server/served_stream.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "base/counted.h"
#include "base/log.h"
#include "base/thread_name.h"
#include "base/time.h"
#include "capture/source/field_source.h"
#include "capture/upright.h"
#include "idl/recorder.h"
#include "idl/stream_recorder.h"
#include "server/ladder.h"
#include "server/pipeline.h"
#include "server/stream_source.h"

namespace relievo {
namespace {

constexpr std::chrono::milliseconds kLook{100};  // at a recorder, in between

/// "12 frames captured, ..." or, of one of several, "left: 12 frames captured, ...".
void say(const std::string& label, const std::string& line) {
  log_info(label.empty() ? line : label + ": " + line);
}

void say_drops(const std::string& label, const ServerStatus& s) {
  say(label, counted(s.frames_captured, "frame") + " captured, " + std::to_string(s.frames_published) +
                 " published; dropped: " + std::to_string(s.drops_capture) + " in capture, " +
                 std::to_string(s.drops_reconstruct) + " before reconstruction, " +
                 std::to_string(s.drops_encode) + " before encoding, " + std::to_string(s.drops_publish) +
                 " before publishing");
}

void say_camera(const std::string& label, const SourceCounts& c) {
  if (c.damaged_pictures + c.restarts + c.reconnects == 0) return;
  say(label, "camera: " + counted(c.damaged_pictures, "damaged picture") + ", " +
                 counted(c.restarts, "restart") + " of its driver, unplugged " +
                 counted(c.reconnects, "time"));
}

/// On a thread of its own: a slow disk keeps that waiting, and not the stream.
std::jthread beside_the_stream(std::function<void()> care) {
  return std::jthread([care = std::move(care)](const std::stop_token& ended) {
    name_this_thread("recording");
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any wake;
    while (!wake.wait_for(lock, ended, kLook, [&] { return ended.stop_requested(); })) care();
  });
}

/// The server's own recorder: a reader of the stream like any other.
struct Recording {
  std::optional<Recorder> recorder;
  std::unique_ptr<Subscriber> subscriber;
  std::jthread beside;  // keeps its chunks short

  Status start(const std::string& file, const std::string& stream, const ServeConfig& config,
               const Publisher& publisher, const std::atomic<bool>& stop) {
    const auto options = recording_options(config.recording);
    if (!options) return options.error();
    // The recorder makes the file with the first sample; that it cannot should be said before.
    if (const Status target = check_recording_target(file, options->segments.split()); !target) return target;
    recorder.emplace(Recorder::Options{.file = file, .stream = stream, .recording = *options});
    auto created = Subscriber::create(domain_options(config), stream, recorder->callbacks());
    if (!created) return created.error();
    subscriber = *std::move(created);
    // The first frame should be in the file: wait until reader and writer have found each other.
    for (int tries = 0; tries < 200 && !stop && publisher.matched_readers() == 0; ++tries) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return {};
  }

  /// After the last frame was published.
  Status finish(const std::string& label, std::uint64_t published) {
    if (!recorder) return {};
    for (int tries = 0; tries < 100 && !recorder->done(); ++tries) {
      const Recorder::Counts counts = recorder->counts();
      if (counts.frames + counts.lost >= published) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    subscriber.reset();
    beside = {};
    const Status done = recorder->finish();
    const Recorder::Counts counts = recorder->counts();
    if (!done)
      return done.error().in("the recording stopped after " + counted(counts.frames, "frame") + "; the " +
                             std::to_string(counts.missed) + " after them are not in it");
    say(label, "recorded " + counted(counts.frames, "frame") + ", " + std::to_string(counts.lost) + " lost" +
                   (counts.files > 1 ? ", in " + std::to_string(counts.files) + " files" : ""));
    return {};
  }
};

/// The recorder that the gateway's API starts and stops.
class OnRequest {
 public:
  OnRequest(RecordingDesk& desk, const std::string& stream) : desk_(desk), stream_(stream) {}
  OnRequest(const OnRequest&) = delete;
  OnRequest& operator=(const OnRequest&) = delete;
  ~OnRequest() { desk_.remove(stream_, last_); }

  Status start(const ServeConfig& config, std::function<void()> key_frame_wanted) {
    const auto pre_roll_s = parse_pre_roll_s(config.pre_roll);
    if (!pre_roll_s) return pre_roll_s.error();
    const auto options = recording_options(config.recording);
    if (!options) return options.error();
    recorder_.emplace(StreamRecorder::Options{.folder = desk_.folder(),
                                              .stream = stream_,
                                              .pre_roll_s = *pre_roll_s,
                                              .recording = *options,
                                              .key_frame_wanted = std::move(key_frame_wanted)});
    auto created = Subscriber::create(domain_options(config), stream_, recorder_->callbacks());
    if (!created) return created.error();
    subscriber_ = *std::move(created);
    desk_.add(stream_, *recorder_);
    return {};
  }
  void finish(const std::string& label, std::uint64_t published) {
    const bool cut = recorder_->state().activity == RecordingActivity::kRecording;
    recorder_->finish(published);
    last_ = recorder_->state();
    if (!cut || last_.activity != RecordingActivity::kOff || last_.file.empty()) return;
    last_.activity = RecordingActivity::kFailed;  // nobody asked for its end
    last_.message = "it ended with the stream, which has begun anew since: start another";
    say(label,
        "the recording " + last_.file + " ended with the stream, after " + counted(last_.frames, "frame"));
  }

 private:
  RecordingDesk& desk_;
  const std::string stream_;
  std::optional<StreamRecorder> recorder_;
  std::unique_ptr<Subscriber> subscriber_;
  RecordingState last_;
};

PipelineOptions pipeline_options(const StreamConfig& config, const std::string& stream) {
  PipelineOptions options;
  options.stream = stream;
  options.paced = !config.fast;
  options.lossless = config.fast;
  options.frames = config.frames;
  options.reconstruct.threads = config.threads;
  const ServedDecoder decoder = served_decoder(config);
  options.reconstruct.decoder = decoder.decoder;
  options.reconstruct.line_stride = config.half_lines ? 2 : 1;
  options.auto_pace = decoder.auto_pace;
  options.reconstruct.surface = config.surface;
  options.encode = encode_options(config);
  options.rate = config.rate;
  return options;
}

/// The lower rungs, and where textures are H.264 each that a browser may want with JPEG textures instead.
std::vector<Rung> rungs_of(const StreamConfig& config) {
  std::vector<Rung> rungs = config.ladder;
  if (config.texture != TextureCodec::kH264) return rungs;
  rungs.push_back(Rung::kFullJpeg);
  for (const Rung rung : config.ladder)
    if (const auto jpeg = jpeg_of(rung)) rungs.push_back(*jpeg);
  return rungs;  // those that an older reader does not know last: it looks at no more than it knows
}

class RunningStream final : public ServedStream {
 public:
  RunningStream(const StreamConfig& config, const Surroundings& around, const std::atomic<bool>& stop)
      : stop_(stop),
        config_(config),
        around_(around),
        name_(name_of(config)),
        label_(around.config.streams.empty() ? "" : name_) {}
  ~RunningStream() override {
    if (announced_) around_.gateway->withdraw(name_);
    if (around_.desk != nullptr && recording_.recorder) around_.desk->remove(*recording_.recorder);
    if (around_.rigs != nullptr) around_.rigs->remove(name_);
    if (around_.stages != nullptr) around_.stages->remove(name_);
    around_.board.forget(name_);
  }

  Status open();
  Status run() override;
  void stop() override {
    stopped_ = true;
    pipeline_->stop();
  }
  void request_key_frame() override {
    pipeline_->request_key_frame();
    if (ladder_) ladder_->request_key_frame();
  }

 private:
  Error stopped_opening() const { return {name_ + " was stopped while it was opened"}; }
  Status announce(const std::string& uri);
  Status raise_ladder(const PipelineOptions& options);

  const std::atomic<bool>& stop_;  // opening
  const StreamConfig config_;
  const Surroundings around_;
  const std::string name_, label_;
  std::unique_ptr<FieldSource> source_;
  UprightRig seen_;  // by the source: what frames are of
  std::unique_ptr<Publisher> publisher_;
  Recording recording_;
  std::optional<OnRequest> on_request_;
  std::vector<std::unique_ptr<FrameSink>> sinks_;
  std::unique_ptr<RigProbe> probe_;
  std::unique_ptr<Ladder> ladder_;
  std::vector<std::unique_ptr<RungPublisher>> rungs_;  // call the ladder, and are called by its thread
  std::unique_ptr<Pipeline> pipeline_;                 // ends that thread
  std::atomic<bool> stopped_{false};
  bool announced_ = false;
};

Status RunningStream::open() {
  auto opened = open_stream_source(config_, around_.config.projector);
  if (!opened) return opened.error();
  if (stop_) return stopped_opening();
  source_ = std::move(opened->source);
  auto seen = upright(source_->info().rig, source_->info().pattern);
  if (!seen) return seen.error();
  seen_ = *std::move(seen);
  if (const Status announced = announce(opened->uri); !announced) return announced;
  if (stop_) return stopped_opening();
  std::vector<FrameSink*> sinks;
  for (const auto& sink : sinks_) sinks.push_back(sink.get());
  PipelineOptions options = pipeline_options(config_, name_);
  options.label = label_;
  options.calibrated = opened->calibrated;
  if (around_.rigs != nullptr) {
    const SourceInfo& info = source_->info();
    probe_ = std::make_unique<RigProbe>(name_, info.rig, info.pattern, seen_);
    options.tap = probe_.get();
  }
  if (const Status raised = raise_ladder(options); !raised) return raised;
  options.rungs = ladder_.get();
  auto pipeline = Pipeline::create(*source_, sinks, options);
  if (!pipeline) return pipeline.error();
  if (probe_) around_.rigs->add(name_, *probe_);
  pipeline_ = *std::move(pipeline);
  if (around_.stages != nullptr)
    around_.stages->add(name_, [pipeline = pipeline_.get(), publisher = publisher_.get()] {
      StageTimes times = pipeline->stages();
      times.sent_again_bytes = publisher->sent_again_bytes();
      times.clients = publisher->client_reports();
      return times;
    });
  return {};
}

Status RunningStream::announce(const std::string& uri) {
  StreamInfo info;
  info.stream = name_;
  info.source = uri;
  info.started_ns = utc_now_ns();
  info.rig = seen_.rig;
  info.pattern = seen_.pattern;
  const auto wish = [wishes = &around_.wishes, name = name_] { wishes->wish(name); };
  auto publisher = Publisher::create(domain_options(around_.config), info, wish);
  if (!publisher) return publisher.error();
  publisher_ = *std::move(publisher);
  if (!config_.record.empty()) {
    if (const Status started = recording_.start(config_.record, name_, around_.config, *publisher_, stop_);
        !started)
      return started;
    if (around_.desk != nullptr) around_.desk->add(*recording_.recorder, config_.record);
  }
  if (around_.desk != nullptr) {
    on_request_.emplace(*around_.desk, name_);
    if (const Status started = on_request_->start(around_.config, wish); !started) return started;
  }
  sinks_.push_back(make_dds_sink(*publisher_));
  if (around_.gateway != nullptr) {
    around_.gateway->announce(info);
    announced_ = true;
    sinks_.push_back(make_gateway_sink(*around_.gateway, name_));
  }
  if (recording_.recorder) {
    auto care = recorder_care(*recording_.recorder, wish);
    if (config_.fast)  // nothing is to be lost: the stream waits for the disk
      sinks_.push_back(make_calling_sink(std::move(care)));
    else
      recording_.beside = beside_the_stream(std::move(care));
  }
  sinks_.push_back(make_service_sink(around_.board, name_));
  return {};
}

Status RunningStream::raise_ladder(const PipelineOptions& options) {
  if (config_.ladder.empty()) return {};
  ladder_ = std::make_unique<Ladder>(seen_.rig, seen_.pattern, options.encode, options.depth_resolution);
  for (const Rung rung : rungs_of(config_)) {
    auto made = RungPublisher::create(domain_options(around_.config), name_, rung,
                                      [ladder = ladder_.get()] { ladder->request_key_frame(); });
    if (!made) return made.error();
    RungPublisher* const publisher = rungs_.emplace_back(*std::move(made)).get();
    if (rung == Rung::kSlow) {
      ladder_->add({.rung = rung,
                    .readers = [publisher] { return publisher->matched_readers(); },
                    .publish = [publisher](const FrameMessage& frame) { return publisher->publish(frame); },
                    .due = [publisher] { return publisher->due(); }});
      continue;
    }
    Gateway* const gateway = around_.gateway;
    ladder_->add({.rung = rung,
                  .readers =
                      [publisher, gateway, rung, name = name_] {
                        const int browsers = gateway == nullptr ? 0 : gateway->watchers(name, rung);
                        return publisher->matched_readers() + browsers;
                      },
                  .publish =
                      [publisher, gateway, name = name_](const FrameMessage& frame) {
                        if (gateway != nullptr) gateway->publish(name, frame);
                        return publisher->publish(frame);
                      }});
  }
  return {};
}

Status RunningStream::run() {
  const Status done = pipeline_->run();
  const ServerStatus ended = pipeline_->status();
  say_drops(label_, ended);
  say_camera(label_, source_->counts());
  if (on_request_) on_request_->finish(label_, ended.frames_published);
  const Status recorded = recording_.finish(label_, ended.frames_published);
  if (!done || !recorded || stopped_) return done ? recorded : done;
  if (ended.frames_published == 0) {
    return Error{
        config_.source + " ended before a frame could be published: " +
        (ended.message.empty() ? "a surface needs two frames under different slides" : ended.message)};
  }
  return {};
}

}  // namespace

DomainOptions domain_options(const ServeConfig& config) {
  return {.domain = config.domain, .interface = config.interface, .keys = config.keys};
}

Result<std::unique_ptr<ServedStream>> ServedStream::open(const StreamConfig& config,
                                                         const Surroundings& surroundings,
                                                         const std::atomic<bool>& stop) {
  auto stream = std::make_unique<RunningStream>(config, surroundings, stop);
  if (const Status opened = stream->open(); !opened) return opened.error();
  return std::unique_ptr<ServedStream>(std::move(stream));
}

}  // namespace relievo
