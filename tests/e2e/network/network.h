// SPDX-License-Identifier: Apache-2.0
// Hosts on a switch, as network namespaces of this process's own: nothing of the machine's network is
// touched, and all is gone with the process. Needs iproute2 and nftables, and a kernel that lets this user
// have them.
#pragma once

#include <string>
#include <vector>

namespace relievo::test {

class Network {
 public:
  /// Why this user can have no network of his own; empty where he can. The process is in it from then on, so
  /// that it must have one thread yet.
  static std::string enter();

  /// Hosts 1 to `hosts`, with MTU 1500. Throws where a command of the system fails.
  explicit Network(int hosts);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  /// `command` as one that runs on a host.
  static std::vector<std::string> on(int host, const std::vector<std::string>& command);
  /// Of each host's only interface but the loopback.
  static constexpr const char* kInterface = "eth0";

  /// So many of 1000 packets to the host, and as many from it, are lost at random.
  void lose(int host, int of_1000);
  /// The cable to the host carries so many kilobits a second, and so long may bytes wait for it; the others
  /// are lost.
  void narrow(int host, int kbit_s, int queue_ms = 50);
  /// Pulls the host's cable, or plugs it in again.
  void cut(int host);
  void join(int host);

 private:
  int hosts_;
};

}  // namespace relievo::test
