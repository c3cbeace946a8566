// SPDX-License-Identifier: Apache-2.0
#include "server/serve.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/log.h"
#include "cli/announce.h"
#include "cli/listen_address.h"
#include "cli/service_manager.h"
#include "codec/video_encoder_kind.h"
#include "idl/cdr.h"
#include "idl/recording_segments.h"
#include "server/calibration_desk.h"
#include "server/recording_desk.h"
#include "server/rig_desk.h"
#include "server/stage_desk.h"
#include "server/stream_set.h"
#include "web/gateway/gateway.h"
#include "web/gateway/key_frame_wishes.h"

namespace relievo {
namespace {

Result<std::unique_ptr<Gateway>> start_gateway(const ServeConfig& config, KeyFrameWishes& wishes,
                                               RecordingDesk* desk, RigDesk& rigs,
                                               CalibrationDesk& calibrations, const StageDesk& stages) {
  if (config.web == "none") return std::unique_ptr<Gateway>();
  const auto address = parse_listen_address(config.web);
  if (!address) return address.error();
  return Gateway::start({.host = address->host,
                         .port = address->port,
                         .web = config.gateway,
                         .key_frame_wanted = [&wishes](const std::string& name) { wishes.wish(name); },
                         .refused_peers = refused_peers,
                         .samples = SampleFormat{.type_name = topic_type(Topic::kFrame).type_name,
                                                 .idl = topic_type(Topic::kFrame).idl,
                                                 .encode =
                                                     [](const std::string& name, const FrameMessage& frame) {
                                                       return write_frame_cdr(name, frame);
                                                     }},
                         .recordings = desk,
                         .rigs = &rigs,
                         .calibrations = &calibrations,
                         .stages = &stages});
}

void print_addresses(const ServeConfig& config, const std::vector<std::string>& streams,
                     const Gateway* gateway) {
  for (const std::string& name : streams)
    announce("stream " + name + " on DDS domain " + std::to_string(config.domain));
  if (gateway != nullptr) {
    const std::string host = parse_listen_address(config.web).value().host;
    announce("viewer " + browser_address({host, gateway->port()}, !config.gateway.tls_cert.empty(),
                                         gateway->made_token()));
  }
}

/// Where the hardware was to make the pictures, if it could.
void say_which_encoder(const std::vector<StreamConfig>& streams) {
  const auto asks = [](const StreamConfig& s) {
    return s.texture == TextureCodec::kH264 && s.texture_encoder == VideoEncoderKind::kAuto;
  };
  if (std::ranges::none_of(streams, asks)) return;
  const ChosenVideoEncoder& chosen = chosen_video_encoder();
  log_info("H.264 by " + std::string(video_encoder_name(chosen.kind)) +
           (chosen.why_not_hardware.empty() ? "" : "; no hardware encoder: " + chosen.why_not_hardware));
}

/// What a running server cannot change.
void say_what_waits(const ServeConfig& now, const ServeConfig& wanted) {
  std::string waits;
  int count = 0;
  const auto compare = [&](const auto& a, const auto& b, const char* name) {
    if (a == b) return;
    waits += ", " + std::string(name);
    ++count;
  };
  compare(now.domain, wanted.domain, "domain");
  compare(now.interface, wanted.interface, "interface");
  compare(now.keys, wanted.keys, "keys");
  compare(now.web, wanted.web, "web");
  compare(now.recording, wanted.recording, "[recording]");
  compare(now.record_folder, wanted.record_folder, "the recordings' folder");
  compare(now.pre_roll, wanted.pre_roll, "pre_roll");
  compare(now.projector, wanted.projector, "[projector]");
  if (count > 0)
    log_warning("of the new configuration" + waits + (count > 1 ? " need" : " needs") + " a restart");
}

/// The folder that it is in is there, as find_mistake() has it.
Status make_record_folder(const ServeConfig& config) {
  if (config.record_folder.empty()) return {};
  std::error_code code;
  std::filesystem::create_directory(config.record_folder, code);
  if (code) return Error{"cannot make the folder " + config.record_folder + ": " + code.message()};
  // The stream is worth having without: perhaps its disk is mended meanwhile.
  if (const Status open = check_record_folder(config.record_folder); !open)
    log_warning("no recording can be started: " + open.error().message);
  return {};
}

/// All of the new configuration, or nothing.
Status reload(const ServeConfig& now, const ReadAgain& again, Gateway* gateway, StreamSet& streams) {
  const auto wanted = again();
  if (!wanted) return wanted.error();
  if (now.streams.empty() != wanted->streams.empty())
    return Error{"between one stream and tables [[stream]] the server must be restarted"};
  if (wanted->record_folder == now.record_folder) {  // it may have gone; another one waits for a restart
    if (const Status made = make_record_folder(*wanted); !made) return made;
  }
  if (gateway != nullptr) {
    if (const Status applied = gateway->apply(wanted->gateway); !applied) return applied;
  }
  say_what_waits(now, *wanted);
  streams.apply(wanted->all_streams());
  log_info("the configuration was read again");
  return {};
}

/// What SIGHUP asks for, also before there is anything that could be read again.
class Reloads {
 public:
  explicit Reloads(StopSignal& stop) : stop_(stop) {
    stop.on_reload([this] {
      const std::lock_guard lock(mutex_);
      reload_ ? reload_() : void(wanted_ = true);
    });
  }
  ~Reloads() { stop_.clear_on_reload(); }
  Reloads(const Reloads&) = delete;
  Reloads& operator=(const Reloads&) = delete;

  /// Calls `reload` at each SIGHUP until destruction, on the thread that takes signals; now, where there was
  /// one.
  void begin(std::function<void()> reload) {
    const std::lock_guard lock(mutex_);
    reload_ = std::move(reload);
    if (std::exchange(wanted_, false)) reload_();
  }

 private:
  StopSignal& stop_;
  std::mutex mutex_;
  std::function<void()> reload_;
  bool wanted_ = false;
};

}  // namespace

Status serve(const ServeConfig& config, const ReadAgain& again, StopSignal& stop) {
  std::optional<Reloads> reloads;
  if (again) reloads.emplace(stop);
  if (const Status made = make_record_folder(config); !made) return made;
  KeyFrameWishes wishes;  // outlives the gateway and the streams
  ServiceBoard board;
  std::optional<RecordingDesk> desk;
  if (!config.record_folder.empty()) desk.emplace(config.record_folder);
  RecordingDesk* const desk_or_none = desk ? &*desk : nullptr;
  RigDesk rigs(config.projector);
  CalibrationDesk calibrations(rigs.driver(), config.projector);
  StageDesk stages;
  // The gateway first: a port in use should fail before anything is opened or announced.
  const auto gateway = start_gateway(config, wishes, desk_or_none, rigs, calibrations, stages);
  if (!gateway) return gateway.error();
  StreamSet streams({.config = config,
                     .wishes = wishes,
                     .board = board,
                     .gateway = gateway->get(),
                     .desk = desk_or_none,
                     .rigs = &rigs,
                     .stages = &stages},
                    !config.streams.empty());
  stop.on_stop([&] {
    tell_stopping();
    calibrations.give_up();
    streams.stop();
  });
  wishes.answer_with([&](const std::string& name) { streams.request_key_frame(name); });
  say_which_encoder(config.all_streams());
  streams.apply(config.all_streams());
  calibrations.open(streams);
  const std::vector<std::string> opened = streams.opened();
  if (!opened.empty() || !config.streams.empty()) {
    print_addresses(config, opened, gateway->get());
    tell_ready();
    if (reloads) {
      reloads->begin([&] {
        const Status reloaded = reload(config, again, gateway->get(), streams);
        if (!reloaded) log_error("nothing was changed: " + reloaded.error().message);
      });
    }
  }
  const Status done = streams.wait();
  calibrations.close();
  reloads.reset();
  stop.clear_on_stop();
  wishes.answer_with({});
  return done;
}

}  // namespace relievo
