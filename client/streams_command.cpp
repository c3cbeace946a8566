// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "cli/checks.h"
#include "client/commands.h"
#include "client/options.h"

namespace relievo {
namespace {

struct Options {
  std::shared_ptr<DomainOptions> domain;
  double wait_s = 1;
  bool json = false;
};

struct Found {
  std::optional<StreamInfo> info;
  std::optional<ServerStatus> status;
};

Result<std::map<std::string, Found>> find_streams(const Options& options, StopSignal& stop) {
  std::mutex mutex;
  std::map<std::string, Found> found;
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& info) {
    std::lock_guard lock(mutex);
    found[info.stream].info = info;
  };
  callbacks.status = [&](const ServerStatus& status) {
    std::lock_guard lock(mutex);
    found[status.stream].status = status;
  };
  callbacks.gone = [&](const std::string& stream) {
    std::lock_guard lock(mutex);
    found.erase(stream);
  };
  auto subscriber = Subscriber::create(*options.domain, "", callbacks);
  if (!subscriber) return subscriber.error();
  stop.wait_for(std::chrono::nanoseconds(static_cast<std::int64_t>(options.wait_s * 1e9)));
  subscriber->reset();
  std::erase_if(found, [](const auto& entry) { return !entry.second.info; });
  return found;
}

nlohmann::json to_json(const Found& found) {
  nlohmann::json j;
  j["stream"] = found.info->stream;
  j["source"] = found.info->source;
  j["started"] = utc_text(found.info->started_ns);
  j["camera"] = {found.info->rig.camera.width, found.info->rig.camera.height};
  j["stripes"] = found.info->pattern.stripes();
  if (found.status) {
    j["state"] = to_string(found.status->state);
    j["message"] = found.status->message;
    j["frame_rate"] = found.status->frame_rate;
    j["frames_published"] = found.status->frames_published;
    j["drops"] = found.status->drops_capture + found.status->drops_reconstruct + found.status->drops_encode +
                 found.status->drops_publish;
    j["latency_ms"] = found.status->latency_ms;
    j["bit_rate"] = found.status->bit_rate;
    j["rate_level"] = found.status->rate_level;
    j["qualities"] = nlohmann::json::array({to_string(Rung::kFull)});
    for (const RungStatus& rung : found.status->rungs)
      if (!is_jpeg(rung.rung)) j["qualities"].push_back(to_string(rung.rung));
    j["mixed"] = found.status->step.mixed;
  }
  return j;
}

void print_table(const std::map<std::string, Found>& found) {
  std::printf("%-20s %-24s %-9s %7s %10s\n", "STREAM", "SOURCE", "STATE", "RATE", "FRAMES");
  for (const auto& [name, stream] : found) {
    const ServerStatus status = stream.status.value_or(ServerStatus{});
    std::printf("%-20s %-24s %-9s %7.1f %10llu  %s\n", name.c_str(), stream.info->source.c_str(),
                stream.status ? std::string(to_string(status.state)).c_str() : "-", status.frame_rate,
                static_cast<unsigned long long>(status.frames_published), status.message.c_str());
  }
}

Status run(const Options& options, StopSignal& stop) {
  auto found = find_streams(options, stop);
  if (!found) return found.error();
  if (options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const auto& entry : *found) list.push_back(to_json(entry.second));
    std::puts(json_text(list).c_str());
  } else if (!found->empty()) {
    print_table(*found);
  }
  if (found->empty()) {
    log_info("no live stream in domain " + std::to_string(options.domain->domain) +
             ": is a server running there, on this network? (--domain, --interface, --wait)");
  }
  return {};
}

}  // namespace

Command streams_command() {
  return {"streams", "List the live streams of a domain", [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            options->domain = add_domain_options(app);
            app.add_option("--wait", options->wait_s, "How long to listen, seconds")
                ->check(number(0, 3600))
                ->capture_default_str();
            app.add_flag("--json", options->json, "Print JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
