// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "client/doctor/machine.h"
#include "client/options.h"
#include "idl/interface.h"

namespace relievo {
namespace {

using Grade = Finding::Grade;

constexpr const char* kGroup = "239.255.0.1";  // the one that DDS participants find each other by
constexpr std::int64_t kReceiveBuffer = std::int64_t{kReceiveBuffer_MiB} << 20;  // bytes
constexpr double kFewLost = 1e-5;  // of all datagrams: not worth a word

Result<NetworkInterface> interface_of(const std::string& wanted) {
  return choose_interface(network_interfaces(), wanted);
}

struct Socket {
  int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ~Socket() {
    if (fd >= 0) close(fd);
  }
};

/// Whether what is sent to the group there is received there.
bool multicast_comes_back(const NetworkInterface& interface) {
  const Socket receiver, sender;
  if (receiver.fd < 0 || sender.fd < 0) return false;
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = inet_addr(kGroup);
  // Bound to the group: no other datagram to that port is taken for ours.
  socklen_t size = sizeof to;
  if (bind(receiver.fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) return false;
  if (getsockname(receiver.fd, reinterpret_cast<sockaddr*>(&to), &size) != 0) return false;
  ip_mreq membership{};
  membership.imr_multiaddr = to.sin_addr;
  membership.imr_interface.s_addr = inet_addr(interface.address.c_str());
  if (setsockopt(receiver.fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0)
    return false;
  setsockopt(sender.fd, IPPROTO_IP, IP_MULTICAST_IF, &membership.imr_interface, sizeof(in_addr));
  const char sent[] = "relievo doctor";
  if (sendto(sender.fd, sent, sizeof sent, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to) < 0)
    return false;
  pollfd wait{receiver.fd, POLLIN, 0};
  return poll(&wait, 1, 1000) == 1;
}

/// "Udp: InDatagrams ..." and the line of numbers behind it, as /proc/net/snmp has them.
std::map<std::string, std::uint64_t> counters(const std::filesystem::path& file) {
  std::map<std::string, std::uint64_t> all;
  std::ifstream in(file);
  std::string names, values;
  while (std::getline(in, names) && std::getline(in, values)) {
    std::istringstream name_words(names), value_words(values);
    std::string protocol, name, ignored;
    std::int64_t value = 0;
    name_words >> protocol;
    value_words >> ignored;
    while (name_words >> name && value_words >> value)
      all[protocol + name] = value < 0 ? 0 : static_cast<std::uint64_t>(value);
  }
  return all;
}

}  // namespace

Finding check_interface(const std::string& wanted) {
  const auto interface = interface_of(wanted);
  if (!interface)
    return {Grade::kTrouble, "interface", interface.error().message, "choose one that is up by --interface"};
  const std::string found =
      interface->name + " (" + interface->address + "), MTU " + std::to_string(interface->mtu);
  if (interface->loopback)
    return {Grade::kAdvice, "interface", found + ": reaches programs of this machine alone",
            "connect a network, or choose another one by --interface"};
  return {Grade::kGood, "interface", found, ""};
}

Finding check_multicast(const std::string& wanted) {
  const auto interface = interface_of(wanted);
  if (!interface) return {Grade::kTrouble, "multicast", "no interface to try it on", "see above"};
  if (interface->loopback) return {Grade::kGood, "multicast", "not needed on " + interface->name, ""};
  if (!interface->multicast)
    return {Grade::kAdvice, "multicast",
            interface->name + " has none: programs on other machines do not find each other",
            "ip link set dev " + interface->name + " multicast on, or name the peers in CYCLONEDDS_URI"};
  if (!multicast_comes_back(*interface))
    return {Grade::kTrouble, "multicast",
            std::string("what is sent to ") + kGroup + " on " + interface->name + " does not come back",
            "let UDP to 239.255.0.0/16 and ports 7400 and up through this machine's firewall"};
  return {Grade::kGood, "multicast", std::string("works on ") + interface->name, ""};
}

Finding check_receive_buffer(const std::filesystem::path& root) {
  std::int64_t most = 0;
  if (!(std::ifstream(root / "proc/sys/net/core/rmem_max") >> most))
    return {Grade::kAdvice, "receive buffer", "the kernel does not say", ""};
  const std::string found = bytes_text(static_cast<std::uint64_t>(most)) + " at most";
  if (most >= kReceiveBuffer) return {Grade::kGood, "receive buffer", found, ""};
  return {Grade::kAdvice, "receive buffer", found + ": bursts of large frames are lost and sent again",
          "sysctl -w net.core.rmem_max=" + std::to_string(kReceiveBuffer) +
              "; to keep it, write that setting to /etc/sysctl.d/60-relievo.conf"};
}

Finding check_lost_datagrams(const std::filesystem::path& root) {
  auto all = counters(root / "proc/net/snmp");
  if (all.empty()) return {Grade::kAdvice, "lost datagrams", "the kernel does not say", ""};
  const std::uint64_t came = all["Udp:InDatagrams"], full = all["Udp:RcvbufErrors"],
                      torn = all["Ip:ReasmFails"];
  const std::string found = std::to_string(full) + " of " + std::to_string(came + full) +
                            " for want of buffer, " + std::to_string(torn) + " put together in vain";
  const double share = static_cast<double>(full) / static_cast<double>(came + full + 1);
  if (share > kFewLost)
    return {Grade::kAdvice, "lost datagrams", found,
            "a larger receive buffer (above), or fewer streams on this machine"};
  const double torn_share = static_cast<double>(torn) / static_cast<double>(all["Ip:ReasmReqds"] + 1);
  if (torn_share > kFewLost)
    return {Grade::kAdvice, "lost datagrams", found,
            "a program sends messages larger than the MTU: other DDS programs may need MaxMessageSize, and a "
            "network that loses packets a look at its cables"};
  return {Grade::kGood, "lost datagrams", found, ""};
}

}  // namespace relievo
