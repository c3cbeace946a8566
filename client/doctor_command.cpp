// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/time.h"
#include "cli/checks.h"
#include "client/commands.h"
#include "client/doctor/machine.h"
#include "client/options.h"
#include "idl/keys.h"

namespace relievo {
namespace {

using Grade = Finding::Grade;

constexpr std::int64_t kSoonNs = 30LL * 24 * 3600 * kNanosecondsPerSecond;

struct Options {
  std::shared_ptr<DomainOptions> domain;
  std::string folder = ".";
  double wait_s = 1;
  bool json = false;
};

Finding check_keys(const std::string& given) {
  const auto folder = find_keys(given);
  if (folder && !*folder)
    return {Grade::kGood, "keys", "none: streams are plain, and for everybody on the network", ""};
  const auto keys = folder ? read_keys(**folder) : folder.error();
  if (!keys)
    return {Grade::kTrouble, "keys", keys.error().message,
            "nothing can be sent or received until this is mended; keys that are damaged are made again by "
            "relievo keys add-client NAME, where the authority is"};
  const std::string found = keys->folder.string() + ": '" + keys->name + "', may " +
                            (keys->may_publish ? "publish and watch" : "watch") + ", until " +
                            utc_text(keys->expires_ns);
  if (keys->expires_ns - utc_now_ns() < kSoonNs)
    return {Grade::kAdvice, "keys", found,
            keys->of_authority ? "they expire soon: relievo keys renew makes new ones"
                               : "they expire soon: relievo keys add-client NAME makes new ones"};
  return {Grade::kGood, "keys", found, ""};
}

Finding check_streams(const Options& options, StopSignal& stop) {
  std::mutex mutex;
  std::set<std::string> live;
  Subscriber::Callbacks callbacks;
  callbacks.info = [&](const StreamInfo& info) {
    std::lock_guard lock(mutex);
    live.insert(info.stream);
  };
  auto subscriber = Subscriber::create(*options.domain, "", callbacks);
  if (!subscriber)
    return {Grade::kTrouble, "streams", subscriber.error().message,
            "no stream can be sent or received until this is mended"};
  stop.wait_for(std::chrono::nanoseconds(static_cast<std::int64_t>(options.wait_s * 1e9)));
  subscriber->reset();
  std::string found = "domain " + std::to_string(options.domain->domain) + " can be joined; ";
  found += live.empty() ? "nothing is live there" : "live there:";
  for (const std::string& name : live) found += " " + name;
  return {Grade::kGood, "streams", found, ""};
}

void print(const std::vector<Finding>& findings) {
  for (const Finding& f : findings) {
    std::printf("%-8s %-15s %s\n", std::string(to_string(f.grade)).c_str(), f.check.c_str(), f.found.c_str());
    if (!f.mend.empty()) std::printf("%24s -> %s\n", "", f.mend.c_str());
  }
}

void print_json(const std::vector<Finding>& findings) {
  nlohmann::json list = nlohmann::json::array();
  for (const Finding& f : findings)
    list.push_back({{"check", f.check}, {"grade", to_string(f.grade)}, {"found", f.found}, {"mend", f.mend}});
  std::puts(json_text(list).c_str());
}

Status run(const Options& options, StopSignal& stop) {
  const std::string& interface = options.domain->interface;
  const std::vector<Finding> findings = {
      check_interface(interface),   check_multicast(interface),
      check_receive_buffer("/"),    check_lost_datagrams("/"),
      check_streams(options, stop), check_keys(options.domain->keys),
      check_disk(options.folder),   check_clock("/"),
      check_cameras("/"),           check_processor("/"),
      check_huge_pages("/"),
  };
  options.json ? print_json(findings) : print(findings);
  const auto count = std::ranges::count(findings, Grade::kTrouble, &Finding::grade);
  if (count == 0) return {};
  return Error{std::to_string(count) + " of " + std::to_string(findings.size()) + " checks found trouble"};
}

}  // namespace

Command doctor_command() {
  return {"doctor", "Check this machine for what live 3D video needs, and say what to change",
          [](CLI::App& app) {
            auto options = std::make_shared<Options>();
            options->domain = add_domain_options(app);
            app.add_option("--folder", options->folder, "Where recordings would go")
                ->type_name("DIR")
                ->capture_default_str();
            app.add_option("--wait", options->wait_s, "How long to listen for streams, seconds")
                ->check(number(0, 3600))
                ->capture_default_str();
            app.add_flag("--json", options->json, "Print JSON");
            return [options](StopSignal& stop) { return run(*options, stop); };
          }};
}

}  // namespace relievo
