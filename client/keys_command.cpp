// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/log.h"
#include "base/time.h"
#include "client/commands.h"
#include "client/options.h"
#include "idl/authority.h"
#include "idl/keys.h"

namespace relievo {
namespace {

struct Options {
  enum class Verb { kNone, kInit, kAdd, kRenew, kRevoke, kList } verb = Verb::kNone;
  std::string folder;
  std::string name;
  std::string out;
  bool publish = false;
  bool json = false;
};

Status init(const std::filesystem::path& folder) {
  if (auto status = create_authority(folder); !status) return status;
  const auto keys = read_keys(folder);
  if (!keys) return keys.error();
  std::printf("%s\n", folder.c_str());
  log_info("authority " + keys->authority + " made; this machine publishes as '" + keys->name +
           "'. Servers and viewers started from now on use these keys; other machines get theirs by relievo "
           "keys add-client NAME. Keep a copy of the folder: with it lost, nobody can be added or revoked");
  if (geteuid() == 0)
    log_info("a server that runs as another user must own the folder: chown -R relievo: " + folder.string() +
             " where systemd starts it");
  return {};
}

Status add(const std::filesystem::path& folder, const Options& options) {
  const std::filesystem::path out = options.out.empty() ? options.name + ".keys" : options.out;
  if (auto status =
          issue_keys(folder, options.name, options.publish ? KeyRole::kPublisher : KeyRole::kWatcher, out);
      !status)
    return status;
  std::printf("%s\n", out.c_str());
  log_info(
      "move this folder to the other machine by a way that nobody reads along, as ~/.config/relievo/keys "
      "(or /etc/relievo/keys, for a service: chown -R relievo: it there), and delete it here");
  return {};
}

Status renew(const std::filesystem::path& folder) {
  if (auto status = renew_keys(folder); !status) return status;
  const auto keys = read_keys(folder);
  if (!keys) return keys.error();
  log_info("new keys for '" + keys->name + "', until " + utc_text(keys->expires_ns) +
           ": restart the servers of this machine");
  return {};
}

Status revoke(const std::filesystem::path& folder, const Options& options) {
  if (auto status = revoke_keys(folder, options.name); !status) return status;
  log_info("the keys of '" + options.name +
           "' count no longer: restart the servers of this machine, and copy " +
           (folder / key_files::kRevoked).string() + " to the keys of those on other machines");
  return {};
}

Status list(const std::filesystem::path& folder, bool as_json) {
  const auto keys = read_keys_of_any_time(folder);
  if (!keys) return keys.error();
  const auto holders = list_keys(folder);  // fails where this is no authority's folder
  if (keys->of_authority && !holders) return holders.error();
  if (const Status time = check_time(*keys); !time) log_warning(time.error().message);
  if (as_json) {
    nlohmann::json j{{"folder", keys->folder.string()},
                     {"authority", keys->authority},
                     {"name", keys->name},
                     {"may_publish", keys->may_publish},
                     {"expires", utc_text(keys->expires_ns)}};
    if (holders) {
      j["holders"] = nlohmann::json::array();
      for (const KeyHolder& holder : *holders)
        j["holders"].push_back({{"name", holder.name},
                                {"serial", holder.serial},
                                {"revoked", holder.revoked},
                                {"expires", utc_text(holder.expires_ns)}});
    }
    std::puts(json_text(j).c_str());
    return {};
  }
  std::printf("folder     %s\nauthority  %s\nname       %s, may %s\nexpires    %s\n", keys->folder.c_str(),
              keys->authority.c_str(), keys->name.c_str(), keys->may_publish ? "publish and watch" : "watch",
              utc_text(keys->expires_ns).c_str());
  if (!holders) return {};
  std::printf("\n%-32s %-8s %s\n", "HOLDER", "STATE", "EXPIRES");
  for (const KeyHolder& holder : *holders)
    std::printf("%-32s %-8s %s\n", holder.name.c_str(),
                holder.revoked                      ? "revoked"
                : holder.expires_ns <= utc_now_ns() ? "expired"
                                                    : "valid",
                utc_text(holder.expires_ns).c_str());
  return {};
}

Status run(const Options& options) {
  std::filesystem::path folder = options.folder;
  if (folder.empty() && options.verb != Options::Verb::kInit) {
    const auto found = find_keys("");
    if (!found) return found.error();
    folder = found->value_or("");
  }
  if (folder.empty()) folder = user_keys_folder();
  switch (options.verb) {
    case Options::Verb::kInit:
      return init(folder);
    case Options::Verb::kAdd:
      return add(folder, options);
    case Options::Verb::kRenew:
      return renew(folder);
    case Options::Verb::kRevoke:
      return revoke(folder, options);
    case Options::Verb::kList:
    case Options::Verb::kNone:
      return list(folder, options.json);
  }
  return {};
}

}  // namespace

Command keys_command() {
  return {
      "keys", "Make and revoke the keys of secured streams (docs/SECURITY.md)", [](CLI::App& app) {
        auto options = std::make_shared<Options>();
        const auto verb = [&app, options](const char* name, const char* what, Options::Verb verb_) {
          CLI::App* sub = app.add_subcommand(name, what);
          sub->fallthrough();  // -q and -v behind it
          sub->add_option("--keys", options->folder,
                          "The folder (default: $RELIEVO_KEYS, ~/.config/relievo/keys or /etc/relievo/keys)")
              ->type_name("DIR");
          sub->callback([options, verb_] {
            options->verb = verb_;
            if (const char* const folder = std::getenv("RELIEVO_KEYS");
                folder != nullptr && options->folder.empty())
              options->folder = folder;
            if (options->folder == "none")
              throw CLI::ValidationError("--keys", "'none' means without keys: name a folder");
          });
          return sub;
        };
        verb("init", "Make an authority, and this machine's keys: its streams are secured from then on",
             Options::Verb::kInit);
        CLI::App* add = verb("add-client", "Make a folder of keys for another machine", Options::Verb::kAdd);
        add->add_option("NAME", options->name, "Whose keys they are")->required();
        add->add_option("--out", options->out, "The new folder (default: NAME.keys)")->type_name("DIR");
        add->add_flag("--publish", options->publish, "They let it publish streams, not only watch");
        verb("renew",
             "Make new keys for this machine, which has the authority, before or after the old ones expire",
             Options::Verb::kRenew);
        verb("revoke", "Let somebody's keys count no longer", Options::Verb::kRevoke)
            ->add_option("NAME", options->name, "Whose")
            ->required();
        verb("list", "Say whose keys these are and who else has some", Options::Verb::kList)
            ->add_flag("--json", options->json, "Print JSON");
        app.require_subcommand(1);
        return [options](StopSignal&) { return run(*options); };
      }};
}

}  // namespace relievo
