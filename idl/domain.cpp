// SPDX-License-Identifier: Apache-2.0
#include "idl/domain.h"

#include <dds/dds.h>

#include <condition_variable>
#include <cstdlib>
#include <map>
#include <mutex>
#include <utility>

#include "base/log.h"
#include "base/secret_file.h"
#include "idl/dds_log.h"
#include "idl/interface.h"
#include "idl/security.h"

namespace relievo {
namespace {

constexpr int kMaxDomain = 230;  // beyond it the ports exceed 65535

constexpr int kBeside = 1000;  // numbers that no domain on the network has

std::mutex g_mutex;
std::condition_variable g_closed;
std::map<int, std::weak_ptr<Domain>> g_domains;  // an expired entry is a domain being closed

bool user_configures() {
  const char* uri = std::getenv("CYCLONEDDS_URI");
  return uri != nullptr && *uri != '\0';
}

Status create_domain(dds_domainid_t id, const std::string& config, Entity& out) {
  log_debug("DDS domain " + std::to_string(id) + ": " + config);
  auto made = take_entity(dds_create_domain(id, config.c_str()), "domain");
  if (!made) return made.error();
  out = std::move(made).value();
  return {};
}

void warn_of_open_keys(const std::filesystem::path& folder) {
  for (const char* secret : {key_files::kPrivate, key_files::kAuthorityKey})
    if (const auto file = folder / secret; readable_by_all(file))
      log_warning("every user of this machine can read the secret in " + file.string() + ": chmod 600 it");
}

}  // namespace

Result<std::shared_ptr<Domain>> Domain::open(const DomainOptions& options) {
  const auto found = find_keys(options.keys);
  if (!found) return found.error();
  const auto& keys = *found;
  if (options.domain < 0 || options.domain > kMaxDomain) {
    return Error{"DDS domain " + std::to_string(options.domain) + " is out of range: use 0 to " +
                 std::to_string(kMaxDomain)};
  }
  std::unique_lock lock(g_mutex);
  for (;;) {
    const auto known = g_domains.find(options.domain);
    if (known == g_domains.end()) break;
    if (auto existing = known->second.lock()) {
      const bool same_keys = existing->keys_ ? keys && existing->keys_->folder == *keys : !keys;
      if (existing->interface_ == options.interface && same_keys) return existing;
      lock.unlock();  // before `existing` goes, which may be the last
      return Error{"DDS domain " + std::to_string(options.domain) + " is already open " +
                   (same_keys ? "on another network interface" : "with other keys") +
                   ": use the same, or another domain"};
    }
    g_closed.wait(lock);
  }
  auto made = make(options, keys);
  if (!made) return made.error();
  const auto close = [number = options.domain](Domain* domain) {
    delete domain;
    {
      std::lock_guard closing(g_mutex);
      g_domains.erase(number);
    }
    g_closed.notify_all();
  };
  std::shared_ptr<Domain> domain(std::move(made).value().release(), close);
  g_domains[options.domain] = domain;
  return domain;
}

Result<std::unique_ptr<Domain>> Domain::make(const DomainOptions& options,
                                             const std::optional<std::filesystem::path>& folder) {
  take_over_dds_log();
  std::unique_ptr<Domain> domain(new Domain);
  domain->interface_ = options.interface;
  if (folder) {
    auto keys = read_keys(*folder);
    if (!keys) return keys.error();
    domain->keys_ = std::move(keys).value();
    warn_of_open_keys(*folder);
    log_debug("keys of '" + domain->keys_->name + "' in " + folder->string());
  }
  const auto id = static_cast<dds_domainid_t>(options.domain);
  if (user_configures()) {
    if (!options.interface.empty()) {
      log_warning("CYCLONEDDS_URI is set, so the network interface is what it says, not " +
                  options.interface);
    }
  } else {
    auto interface = choose_interface(network_interfaces(), options.interface);
    if (!interface) return interface.error();
    if (auto made = create_domain(id, domain_config(*interface), domain->domain_); !made)
      return made.error().in("cannot open DDS domain " + std::to_string(options.domain) + " on " +
                             interface->name);
    if (domain->keys_) {
      if (auto made = domain->open_beside(options.domain, *interface); !made) return made.error();
    }
  }
  auto participant = domain->keys_ ? create_secured_participant(options.domain, *domain->keys_)
                                   : take_entity(dds_create_participant(id, nullptr, nullptr), "participant");
  if (!participant) return participant.error();
  domain->participant_ = std::move(participant).value();
  return domain;
}

// Cyclone 0.10 cannot have plain and secured participants in one domain of a process; in two that are the
// same on the network it can.
Status Domain::open_beside(int domain, const NetworkInterface& interface) {
  const auto id = static_cast<dds_domainid_t>(domain + kBeside);
  if (auto made = create_domain(id, domain_config(interface, domain), plain_domain_); !made) return made;
  auto participant = take_entity(dds_create_participant(id, nullptr, nullptr), "participant");
  if (!participant) return participant.error();
  plain_participant_ = std::move(participant).value();
  return {};
}

}  // namespace relievo
