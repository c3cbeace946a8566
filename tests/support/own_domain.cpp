// SPDX-License-Identifier: Apache-2.0
#include "tests/support/own_domain.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

namespace relievo::test {
namespace {

constexpr int kDomains = 100;  // 1 to 100: their ports lie below those that the kernel gives away

// A domain is taken where a socket of its name exists: an abstract one, which the kernel removes with the
// last process that holds it, and which is seen exactly where the domain's own ports are, in this network
// namespace.
bool take(int domain) {
  const std::string name = "relievo-test-domain-" + std::to_string(domain);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  const int fd = socket(AF_UNIX, SOCK_DGRAM, 0);  // children inherit it
  if (fd >= 0 && bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return true;
  if (fd >= 0) close(fd);
  return false;
}

int choose() {
  if (const char* given = std::getenv("RELIEVO_TEST_DOMAIN")) return std::atoi(given);  // our parent holds it
  for (int i = 0; i < kDomains; ++i) {
    const int domain = 1 + (getpid() + i) % kDomains;
    if (take(domain)) return domain;
  }
  throw std::runtime_error("every DDS domain for tests is taken");
}

}  // namespace

int own_domain() {
  static const int domain = [] {
    setenv("RELIEVO_KEYS", "none", 0);  // whatever keys the user has
    return choose();
  }();
  return domain;
}

}  // namespace relievo::test
