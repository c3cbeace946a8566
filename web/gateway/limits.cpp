// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/limits.h"

#include <algorithm>

#include "base/time.h"

namespace relievo {
namespace {

constexpr std::size_t kRemembered = 4096;  // addresses, before those that owe nothing are forgotten

}  // namespace

double Bucket::level_at(std::int64_t now_ns) const {
  return std::min(rate_.burst, level_ + seconds(std::max<std::int64_t>(0, now_ns - then_ns_)) * rate_.per_s);
}

bool Bucket::take(std::int64_t now_ns) {
  level_ = level_at(now_ns);
  then_ns_ = std::max(then_ns_, now_ns);
  if (level_ < 1) return false;
  level_ -= 1;
  return true;
}

AddressLimits::Entry& AddressLimits::entry(const std::string& address, std::int64_t now_ns) {
  if (entries_.size() >= kRemembered && entries_.count(address) == 0) {
    std::erase_if(entries_, [&](const auto& known) {
      return known.second.connections == 0 && known.second.requests.full(now_ns);
    });
  }
  return entries_.try_emplace(address, Entry{0, Bucket(requests_, now_ns)}).first->second;
}

void AddressLimits::change(int connections, Rate requests, std::int64_t now_ns) {
  connections_ = connections;
  requests_ = requests;
  for (auto& [address, known] : entries_) known.requests = Bucket(requests, now_ns);
}

bool AddressLimits::connect(const std::string& address, std::int64_t now_ns) {
  Entry& known = entry(address, now_ns);
  if (known.connections >= connections_) return false;
  ++known.connections;
  return true;
}

void AddressLimits::disconnect(const std::string& address) {
  const auto known = entries_.find(address);
  if (known != entries_.end() && known->second.connections > 0) --known->second.connections;
}

bool AddressLimits::request(const std::string& address, std::int64_t now_ns) {
  return entry(address, now_ns).requests.take(now_ns);
}

}  // namespace relievo
