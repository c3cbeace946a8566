// SPDX-License-Identifier: Apache-2.0
#include "idl/interface.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

namespace relievo {
namespace {

int mtu_of(int socket_fd, const std::string& name) {
  ifreq request{};
  if (name.size() >= sizeof request.ifr_name) return 1500;
  std::memcpy(request.ifr_name, name.data(), name.size());
  return ioctl(socket_fd, SIOCGIFMTU, &request) == 0 ? request.ifr_mtu : 1500;
}

struct MessageSize {
  int message;   // bytes of a UDP payload
  int fragment;  // bytes of a sample in it
};

// A sample's fragment is lost when any IP fragment of its datagram is, so a datagram should fit the MTU.
// Where nothing is lost (loopback) or the MTU is jumbo, large messages cost the least.
MessageSize message_size(const NetworkInterface& interface) {
  if (interface.loopback || interface.mtu >= 9000) return {65500, 64000};
  const int message = std::clamp(interface.mtu - 60, 600, 1440);
  return {message, message - 140};
}

}  // namespace

std::vector<NetworkInterface> network_interfaces() {
  std::vector<NetworkInterface> all;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return all;
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  for (const ifaddrs* i = list; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET || (i->ifa_flags & IFF_UP) == 0) continue;
    sockaddr_in address{};
    std::memcpy(&address, i->ifa_addr, sizeof address);
    char text[INET_ADDRSTRLEN] = {};
    if (inet_ntop(AF_INET, &address.sin_addr, text, sizeof text) == nullptr) continue;
    NetworkInterface found;
    found.name = i->ifa_name;
    found.address = text;
    found.mtu = mtu_of(fd, found.name);
    found.loopback = (i->ifa_flags & IFF_LOOPBACK) != 0;
    found.multicast = (i->ifa_flags & IFF_MULTICAST) != 0;
    all.push_back(found);
  }
  if (fd >= 0) close(fd);
  freeifaddrs(list);
  return all;
}

Result<NetworkInterface> choose_interface(const std::vector<NetworkInterface>& all,
                                          const std::string& wanted) {
  const auto first = [&](auto accept) { return std::find_if(all.begin(), all.end(), accept); };
  if (!wanted.empty()) {
    const auto named = first([&](const auto& i) { return i.name == wanted || i.address == wanted; });
    if (named != all.end()) return *named;
    std::string names;
    for (const auto& i : all) names += (names.empty() ? "" : ", ") + i.name + " (" + i.address + ")";
    return Error{"no network interface '" + wanted + "' that is up; there are " +
                 (names.empty() ? "none" : names)};
  }
  auto chosen = first([](const auto& i) { return !i.loopback && i.multicast; });
  if (chosen == all.end()) chosen = first([](const auto& i) { return !i.loopback; });
  if (chosen == all.end()) chosen = all.begin();
  if (chosen == all.end()) {
    return Error{"no network interface with an IPv4 address is up: bring one up, e.g. ip link set lo up"};
  }
  return *chosen;
}

std::string domain_config(const NetworkInterface& interface, std::optional<int> on_network) {
  const MessageSize size = message_size(interface);
  const bool multicast = interface.multicast && !interface.loopback;
  std::string xml = "<General><Interfaces><NetworkInterface name=\"" + interface.name + "\"/></Interfaces>";
  xml += std::string("<AllowMulticast>") + (multicast ? "spdp" : "false") + "</AllowMulticast>";
  xml += "<MaxMessageSize>" + std::to_string(size.message) + "B</MaxMessageSize>";
  xml += "<FragmentSize>" + std::to_string(size.fragment) + "B</FragmentSize></General>";
  xml += "<Discovery><ParticipantIndex>auto</ParticipantIndex>";
  xml += "<MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>";
  // Without multicast participants find each other by asking every port of the machine itself: not often.
  // With it one packet tells all, and who was cut off for so long that both sides forgot each other is back
  // soon.
  xml += multicast ? "<SPDPInterval>2s</SPDPInterval>"
                   : "<Peers><Peer address=\"" + interface.address + "\"/></Peers>";
  if (on_network) xml += "<ExternalDomainId>" + std::to_string(*on_network) + "</ExternalDomainId>";
  xml += "</Discovery>";
  // min="default": take what the kernel grants (net.core.rmem_max) instead of failing.
  xml += "<Internal><SocketReceiveBufferSize min=\"default\" max=\"" + std::to_string(kReceiveBuffer_MiB) +
         "MB\"/>";
  xml += "<NackDelay>10ms</NackDelay></Internal>";
  xml += "<Sizing><ReceiveBufferSize>4MB</ReceiveBufferSize></Sizing>";
  return "<CycloneDDS><Domain>" + xml + "</Domain></CycloneDDS>";
}

}  // namespace relievo
