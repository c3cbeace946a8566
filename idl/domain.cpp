// SPDX-License-Identifier: Apache-2.0
#include "idl/domain.h"

#include <dds/dds.h>

#include <condition_variable>
#include <cstdlib>
#include <map>
#include <mutex>
#include <utility>

#include "base/log.h"
#include "idl/interface.h"

namespace relievo {
namespace {

constexpr int kMaxDomain = 230;  // beyond it the ports exceed 65535

std::mutex g_mutex;
std::condition_variable g_closed;
std::map<int, std::weak_ptr<Domain>> g_domains;  // an expired entry is a domain being closed

bool user_configures() {
  const char* uri = std::getenv("CYCLONEDDS_URI");
  return uri != nullptr && *uri != '\0';
}

}  // namespace

Result<std::shared_ptr<Domain>> Domain::open(const DomainOptions& options) {
  if (options.domain < 0 || options.domain > kMaxDomain) {
    return Error{"DDS domain " + std::to_string(options.domain) + " is out of range: use 0 to " +
                 std::to_string(kMaxDomain)};
  }
  std::unique_lock lock(g_mutex);
  for (;;) {
    const auto known = g_domains.find(options.domain);
    if (known == g_domains.end()) break;
    if (auto existing = known->second.lock()) {
      if (existing->interface_ == options.interface) return existing;
      lock.unlock();  // before `existing` goes, which may be the last
      return Error{"DDS domain " + std::to_string(options.domain) +
                   " is already open on another network interface: use the same one, or another domain"};
    }
    g_closed.wait(lock);
  }
  auto made = make(options);
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

Result<std::unique_ptr<Domain>> Domain::make(const DomainOptions& options) {
  std::unique_ptr<Domain> domain(new Domain);
  domain->interface_ = options.interface;
  const auto id = static_cast<dds_domainid_t>(options.domain);
  if (user_configures()) {
    if (!options.interface.empty()) {
      log_warning("CYCLONEDDS_URI is set, so the network interface is what it says, not " +
                  options.interface);
    }
  } else {
    auto interface = choose_interface(network_interfaces(), options.interface);
    if (!interface) return interface.error();
    const std::string config = domain_config(*interface);
    log_debug("DDS domain " + std::to_string(options.domain) + " on " + interface->name + ": " + config);
    auto made = take_entity(dds_create_domain(id, config.c_str()),
                            "domain " + std::to_string(options.domain) + " on " + interface->name);
    if (!made) return made.error();
    domain->domain_ = std::move(made).value();
  }
  auto participant = take_entity(dds_create_participant(id, nullptr, nullptr), "participant");
  if (!participant) return participant.error();
  domain->participant_ = std::move(participant).value();
  return domain;
}

}  // namespace relievo
