// SPDX-License-Identifier: Apache-2.0
#include "tests/e2e/network/network.h"

#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "tests/support/process.h"

namespace relievo::test {
namespace {

const std::string kIp = "/usr/sbin/ip";
const std::string kNft = "/usr/sbin/nft";
const std::string kTc = "/usr/sbin/tc";

std::string host_name(int host) {
  return "h" + std::to_string(host);
}
std::string port_name(int host) {
  return "port" + std::to_string(host);
}  // of the switch

/// Words are parted by single spaces.
void must(const std::string& line) {
  std::vector<std::string> command;
  std::istringstream words(line);
  for (std::string word; words >> word;) command.push_back(word);
  const Finished done = run(command);
  if (done.status != 0) throw std::runtime_error(line + ": " + done.err);
}

void write(const char* file, const std::string& text) {
  std::ofstream(file) << text;
}

std::string failure(const std::string& what) {
  return what + ": " + std::strerror(errno);
}

}  // namespace

std::string Network::enter() {
  for (const std::string& program : {kIp, kNft}) {
    if (access(program.c_str(), X_OK) != 0) return program + " is missing (iproute2, nftables)";
  }
  const auto uid = std::to_string(geteuid()), gid = std::to_string(getegid());
  const bool root = geteuid() == 0;
  if (unshare(CLONE_NEWNET | CLONE_NEWNS | (root ? 0 : CLONE_NEWUSER)) != 0)
    return failure("no network namespace");
  if (!root) {
    write("/proc/self/setgroups", "deny");
    write("/proc/self/uid_map", "0 " + uid + " 1");
    write("/proc/self/gid_map", "0 " + gid + " 1");
  }
  // Names of namespaces are files of /run, which is this process's own too.
  if (mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) return failure("no private mounts");
  if (mount("tmpfs", "/run", "tmpfs", 0, "size=1m") != 0) return failure("no /run of its own");
  return {};
}

Network::Network(int hosts) : hosts_(hosts) {
  must(kIp + " link set lo up");
  must(kIp + " link add switch type bridge");
  must(kIp + " link set switch up");
  must(kNft + " add table netdev losses");
  for (int host = 1; host <= hosts_; ++host) {
    const std::string name = host_name(host), port = port_name(host);
    must(kIp + " netns add " + name);
    must(kIp + " link add " + port + " type veth peer name " + kInterface + " netns " + name);
    must(kIp + " link set " + port + " master switch up");
    must(kIp + " -n " + name + " link set lo up");
    must(kIp + " -n " + name + " addr add 10.77.0." + std::to_string(host) + "/24 dev " + kInterface);
    must(kIp + " -n " + name + " link set " + kInterface + " up");
  }
}

Network::~Network() {
  for (int host = 1; host <= hosts_; ++host) run({kIp, "netns", "delete", host_name(host)});
  run({kNft, "delete", "table", "netdev", "losses"});
  run({kIp, "link", "delete", "switch"});
}

std::vector<std::string> Network::on(int host, const std::vector<std::string>& command) {
  std::vector<std::string> there{kIp, "netns", "exec", host_name(host)};
  there.insert(there.end(), command.begin(), command.end());
  return there;
}

void Network::lose(int host, int of_1000) {
  const std::string rule = " numgen random mod 1000 < " + std::to_string(of_1000) + " drop";
  const std::string hook = " { type filter hook ingress device ";
  const std::string in_host = kIp + " netns exec " + host_name(host) + " " + kNft + " ";
  must(in_host + "add table netdev losses");
  must(in_host + "add chain netdev losses in" + hook + kInterface + " priority 0 ; }");
  must(in_host + "add rule netdev losses in" + rule);
  must(kNft + " add chain netdev losses " + port_name(host) + hook + port_name(host) + " priority 0 ; }");
  must(kNft + " add rule netdev losses " + port_name(host) + rule);
}

void Network::narrow(int host, int kbit_s, int queue_ms) {
  must(kTc + " qdisc add dev " + port_name(host) + " root tbf rate " + std::to_string(kbit_s) +
       "kbit burst 16kb latency " + std::to_string(queue_ms) + "ms");
}

void Network::cut(int host) {
  must(kIp + " link set " + port_name(host) + " down");
}
void Network::join(int host) {
  must(kIp + " link set " + port_name(host) + " up");
}

}  // namespace relievo::test
