// SPDX-License-Identifier: Apache-2.0
// The service manager's end of the socket in NOTIFY_SOCKET (sd_notify(3)).
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "tests/support/patience.h"

namespace relievo::test {

class ServiceManager {
 public:
  explicit ServiceManager(const std::filesystem::path& path)
      : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    address_.sun_family = AF_UNIX;
    std::strncpy(address_.sun_path, path.c_str(), sizeof address_.sun_path - 1);
    bound_ = bind(fd_, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) == 0;
  }
  ~ServiceManager() { close(fd_); }
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  bool bound() const { return bound_; }
  /// All that was said so far.
  const std::string& said() {
    char text[1024];
    for (ssize_t n; (n = recv(fd_, text, sizeof text, MSG_DONTWAIT)) > 0;)
      said_ += std::string(text, static_cast<std::size_t>(n)) + "\n";
    return said_;
  }
  /// Leaves no room for what is said until said() or hears().
  void fill_up() const {
    const int other = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    while (sendto(other, "X", 1, 0, reinterpret_cast<const sockaddr*>(&address_), sizeof address_) == 1) {
    }
    close(other);
  }
  bool hears(const std::string& text) {
    return eventually([&] { return said().find(text) != std::string::npos; });
  }

 private:
  int fd_;
  sockaddr_un address_{};
  bool bound_ = false;
  std::string said_;
};

}  // namespace relievo::test
