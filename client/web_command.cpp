// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "base/log.h"
#include "base/time.h"
#include "cli/announce.h"
#include "cli/checks.h"
#include "cli/listen_address.h"
#include "cli/service_manager.h"
#include "cli/web_flags.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/options.h"
#include "client/player.h"
#include "client/recorded_stream.h"
#include "client/rung_relay.h"
#include "codec/recording_follower.h"
#include "idl/cdr.h"
#include "web/gateway/gateway.h"
#include "web/gateway/key_frame_wishes.h"

namespace relievo {
namespace {

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::vector<std::string> inputs;
  std::string listen = "127.0.0.1:8080";
  std::shared_ptr<WebOptions> web;
};

constexpr std::chrono::milliseconds kTick{200};
constexpr double kLongestPause_s = 5;  // of a recording, whose time line shows the whole of it
constexpr std::int64_t kLeft_ns = 5 * kNanosecondsPerSecond;  // nobody writes a file that long unchanged

Subscriber::Callbacks forward_to(Gateway& gateway, RungRelay& relay) {
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& info) {
    gateway.announce(info, ServerClock::kElsewhere);
    relay.add(info.stream);
  };
  callbacks.frame = [&](const std::string& stream, const FrameMessage& frame) {
    gateway.publish(stream, frame);
  };
  callbacks.status = [&](const ServerStatus& status) { gateway.publish(status); };
  callbacks.gone = [&](const std::string& stream) {
    relay.remove(stream);
    gateway.withdraw(stream);
  };
  return callbacks;
}

// A recording played in a loop on a thread of its own, straight into the gateway. One that is being written
// is gone on with at its end. Pages read the file itself, which grows for them.
class LoopedFile {
 public:
  LoopedFile(std::string file, RecordedStream recorded, Gateway& gateway, StopSignal& stop)
      : file_(std::move(file)), recorded_(std::move(recorded)), gateway_(gateway), name_(recorded_.stream()) {
    // Before anyone is told the address: who follows it at once finds the stream.
    if (auto info = recorded_.find_info(); info && *info) (void)publish(**info).ok();
    if (is_being_written()) follower_.emplace(file_);
    look();
    thread_ = std::thread([this, &stop] { run(stop); });
  }
  LoopedFile(const LoopedFile&) = delete;
  LoopedFile& operator=(const LoopedFile&) = delete;
  /// The stop signal must be given before.
  ~LoopedFile() { thread_.join(); }

  /// To be called every few tenths of a second, on the thread that made it: offers what there is to read.
  void look() {
    std::error_code gone;
    const auto bytes = std::filesystem::file_size(file_, gone);
    tell_of(gone ? "is gone: " + gone.message() : bytes == 0 ? "has become empty" : "");
    if (gone || bytes == 0) return gateway_.offer(name_, {});  // it is played on as far as it is open
    OfferedRecording offered{.file = file_, .whole = whole_ && bytes >= bytes_};
    if (follower_) {
      const auto found = follower_->look();
      const std::int64_t now_ns = steady_now_ns();
      if (!found && !std::exchange(damaged_, true))
        log_warning(found.error().message + ": pages have what is before that");
      if (found && *found == RecordingFollower::Found::kMore) came_ns_ = now_ns;
      offered.growing = follower_->growing();
      offered.has_index = found && *found == RecordingFollower::Found::kFinished;
      offered.grows = found && !offered.has_index && now_ns - came_ns_ < kLeft_ns;
    }
    gateway_.offer(name_, offered);
  }

 private:
  void run(StopSignal& stop) {
    const Status status = play(recorded_, {.loop = true, .follow = true, .longest_pause_s = kLongestPause_s},
                               stop, [this](const RawSample& sample) { return publish(sample); });
    if (!status) {
      log_error(file_ + ": " + status.error().message);
      gateway_.withdraw(recorded_.stream());
    }
  }

  /// Each change once; "": all is well.
  void tell_of(const std::string& missing) {
    if (missing == missing_) return;
    if (!missing.empty()) log_warning(file_ + " " + missing + "; pages cannot read it");
    if (missing.empty()) log_info(file_ + " is there again");
    missing_ = missing;
  }

  static std::uint64_t size_of(const std::string& file) {
    std::error_code ignored;
    const auto bytes = std::filesystem::file_size(file, ignored);
    return ignored ? 0 : bytes;
  }

  bool is_being_written() const {
    std::error_code ignored;
    const auto age =
        std::filesystem::file_time_type::clock::now() - std::filesystem::last_write_time(file_, ignored);
    return recorded_.summary().recovered && age < std::chrono::nanoseconds(kLeft_ns);
  }

  // Unreadable samples are skipped: the viewer counts the gap.
  Status publish(const RawSample& sample) {
    if (sample.topic == Topic::kInfo) {
      if (auto info = read_info_cdr(sample.cdr)) gateway_.announce(*info);
    } else if (sample.topic == Topic::kStatus) {
      auto status = read_status_cdr(sample.cdr);
      if (!status) return {};
      status->rungs.clear();  // its server's then: here there is what was recorded
      gateway_.publish(*status);
    } else if (auto frame = read_frame_cdr(sample.cdr)) {
      FrameMessage message;
      message.sequence = sequence_++;  // goes on over the loop's seam
      message.number = frame->number;
      // As if it were captured now with its latency of then: viewers show the way from here to them.
      message.publish_time_ns = utc_now_ns();
      message.capture_time_ns = message.publish_time_ns - (frame->publish_time_ns - frame->capture_time_ns);
      message.data = std::make_shared<const Bytes>(frame->data.begin(), frame->data.end());
      gateway_.publish(frame->stream, message);
    }
    return {};
  }

  std::string file_;
  RecordedStream recorded_;
  Gateway& gateway_;
  std::uint64_t sequence_ = 0;
  const std::string name_;
  const bool whole_ = !recorded_.summary().recovered;
  const std::uint64_t bytes_ = size_of(file_);  // when it was opened: with less of them it is not whole
  std::string missing_;                         // why it cannot be read, as it was told
  std::optional<RecordingFollower> follower_;   // of what is, or was, being written
  std::int64_t came_ns_ = steady_now_ns();      // when it was last longer than before
  bool damaged_ = false;
  std::thread thread_;
};

struct Inputs {
  std::vector<std::pair<std::string, RecordedStream>> files;
  std::vector<std::string> live;  // "" for all of the domain
};

Result<Inputs> sort_inputs(const std::vector<std::string>& names) {
  Inputs inputs;
  std::set<std::string> streams;
  for (const std::string& name : names) {
    const auto file = is_file(name);
    if (!file) return file.error();
    std::string stream = name;
    if (*file) {
      auto recorded = RecordedStream::open(name, "");
      if (!recorded) return recorded.error();
      stream = recorded->stream();
      inputs.files.emplace_back(name, std::move(*recorded));
    } else {
      inputs.live.push_back(name);
    }
    if (!streams.insert(stream).second) {
      return Error{"stream '" + stream + "' is given twice: serve one of them at another address"};
    }
  }
  if (names.empty()) inputs.live.emplace_back();
  return inputs;
}

Status run(const Options& options, StopSignal& stop) {
  auto address = parse_listen_address(options.listen);
  if (!address) return address.error();
  if (const Status sound = check_web_options(*options.web); !sound) return sound.error();
  auto inputs = sort_inputs(options.inputs);
  if (!inputs) return inputs.error();
  KeyFrameWishes wishes;  // outlives the gateway
  auto gateway = Gateway::start(
      {.host = address->host,
       .port = address->port,
       .web = *options.web,
       .empty_hint = "No live stream in DDS domain " + std::to_string(options.domain->domain) +
                     " yet: start relievo-server serve there.",
       .key_frame_wanted = [&](const std::string& stream) { wishes.wish(stream); },
       .refused_peers = refused_peers,
       .samples = SampleFormat{.type_name = topic_type(Topic::kFrame).type_name,
                               .idl = topic_type(Topic::kFrame).idl,
                               .encode = [](const std::string& name, const FrameMessage& frame) {
                                 return write_frame_cdr(name, frame);
                               }}});
  if (!gateway) return gateway.error();

  RungRelay relay(*options.domain, **gateway);
  std::vector<std::unique_ptr<Subscriber>> subscribers;
  for (const std::string& stream : inputs->live) {
    auto subscriber = Subscriber::create(*options.domain, stream, forward_to(**gateway, relay));
    if (!subscriber) return subscriber.error();
    subscribers.push_back(std::move(*subscriber));
  }
  wishes.answer_with([&](const std::string& stream) {
    for (std::size_t i = 0; i < subscribers.size(); ++i)
      if (inputs->live[i].empty() || inputs->live[i] == stream) subscribers[i]->request_key_frame(stream);
  });
  std::vector<std::unique_ptr<LoopedFile>> files;
  for (auto& [file, recorded] : inputs->files) {
    files.push_back(std::make_unique<LoopedFile>(file, std::move(recorded), **gateway, stop));
  }
  announce("viewer " + browser_address({address->host, (*gateway)->port()}, !options.web->tls_cert.empty(),
                                       (*gateway)->made_token()));
  tell_ready();
  while (!stop.wait_for(kTick)) {
    relay.update();
    for (const auto& file : files) file->look();
  }
  tell_stopping();
  wishes.answer_with({});
  return {};
}

}  // namespace

Command web_command() {
  return {
      "web", "Serve the viewer for live streams and recordings", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        options->domain = add_domain_options(app);
        app.add_option(
               "inputs", options->inputs,
               "Recordings, played in a loop (pauses above 5 s as 5 s), and live streams (default: all of "
               "the domain)")
            ->type_name("FILE|STREAM");
        app.add_option("--listen", options->listen,
                       "Where browsers find the viewer; :PORT for every interface")
            ->type_name("HOST:PORT")
            ->check(listen_address())
            ->capture_default_str();
        options->web = add_web_flags(app);
        app.footer(
            "Examples:\n"
            "  relievo web face.mcap\n"
            "  relievo web --listen :8080                      prints the address with the token it needs\n"
            "  relievo web --listen :8443 --tls-cert rig.pem --tls-key rig.key --token-file tokens");
        return [options](StopSignal& stop) { return run(*options, stop); };
      }};
}

}  // namespace relievo
