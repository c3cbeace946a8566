// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "cli/announce.h"
#include "cli/checks.h"
#include "cli/listen_address.h"
#include "cli/service_manager.h"
#include "cli/web_flags.h"
#include "client/commands.h"
#include "client/input.h"
#include "client/looped_file.h"
#include "client/options.h"
#include "client/rung_relay.h"
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

struct Inputs {
  std::vector<FoundRecording> files;
  std::vector<std::string> live;  // "" for all of the domain
  std::set<std::string> streams;  // that are named, or in these files
};

Result<Inputs> sort_inputs(const std::vector<std::string>& names) {
  Inputs inputs;
  for (const std::string& name : names) {
    const auto file = is_file(name);
    if (!file) return file.error();
    std::string stream = name;
    if (*file) {
      auto found = FoundRecording::open(name);
      if (!found) return found.error();
      stream = found->recorded.stream();
      inputs.files.push_back(*std::move(found));
    } else {
      inputs.live.push_back(name);
    }
    if (!inputs.streams.insert(stream).second) {
      return Error{"stream '" + stream + "' is given twice: serve one of them at another address"};
    }
  }
  if (names.empty()) inputs.live.emplace_back();
  return inputs;
}

/// What a page says while there is no stream.
std::string empty_hint(const Inputs& inputs, const DomainOptions& domain) {
  if (!inputs.live.empty())
    return "No live stream in DDS domain " + std::to_string(domain.domain) +
           " yet: start relievo-server serve there.";
  std::string files;
  for (const FoundRecording& found : inputs.files) files += (files.empty() ? "" : ", ") + found.file;
  return "Nothing of " + files + " can be played now: relievo web says why where it was started.";
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
       .empty_hint = empty_hint(*inputs, *options.domain),
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
  for (FoundRecording& found : inputs->files)
    files.push_back(std::make_unique<LoopedFile>(std::move(found), inputs->streams, **gateway, stop));
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
