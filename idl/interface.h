// SPDX-License-Identifier: Apache-2.0
// Which network interface a domain uses, and the Cyclone DDS configuration that follows from it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"

namespace relievo {

inline constexpr int kReceiveBuffer_MiB = 8;  // of a socket, where the kernel grants it: net.core.rmem_max

struct NetworkInterface {
  std::string name;     // "eth0"
  std::string address;  // IPv4, dotted
  int mtu = 1500;       // bytes
  bool loopback = false;
  bool multicast = false;
};

/// The interfaces that are up and have an IPv4 address, as the system lists them.
std::vector<NetworkInterface> network_interfaces();

/// The one named (by name or address) or, where `wanted` is empty, the first that is multicast capable and
/// not the loopback, else the first that is not the loopback, else the loopback. Fails where there is none.
Result<NetworkInterface> choose_interface(const std::vector<NetworkInterface>& all,
                                          const std::string& wanted);

/// The CYCLONEDDS_URI for it: message and fragment sizes that survive loss at its MTU, a large receive buffer
/// where the kernel grants one, discovery that works without multicast on the loopback. `on_network`: the
/// domain's number there, where it is another than in the process.
std::string domain_config(const NetworkInterface& interface, std::optional<int> on_network = {});

}  // namespace relievo
