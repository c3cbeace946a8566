// SPDX-License-Identifier: Apache-2.0
// What a gateway needs of the servers beside their streams: the other rungs that its clients wish for,
// and how far the servers' clocks are from this one's.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "idl/transport.h"
#include "web/gateway/gateway.h"

namespace relievo {

class RungRelay {
 public:
  /// `gateway` must outlive it.
  RungRelay(const DomainOptions& domain, Gateway& gateway) : domain_(domain), gateway_(gateway) {}

  /// A stream has come or gone. Any thread.
  void add(const std::string& stream);
  void remove(const std::string& stream);

  /// Begins to read the rungs that clients wish for and ends those that none does any more; compares clocks.
  /// A few times a second, by one thread.
  void update();

 private:
  struct Stream {
    std::unique_ptr<ClockProbe> clock;
    std::int64_t asked_ns = 0;
    std::map<Rung, std::unique_ptr<Subscriber>> rungs;
  };
  void update(const std::string& name, Stream& stream);
  void relay(const std::string& name, Stream& stream, Rung rung);

  const DomainOptions domain_;
  Gateway& gateway_;
  std::mutex mutex_;
  std::set<std::string> live_;             // under the mutex
  std::map<std::string, Stream> streams_;  // of update()
};

}  // namespace relievo
