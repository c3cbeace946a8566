// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/tcp_state.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <optional>

namespace relievo {
namespace {

constexpr int kEstablished = 1;  // TCP_ESTABLISHED of <netinet/tcp.h>, which excludes the kernel's

std::optional<tcp_info> info_of(int socket) {
  tcp_info info{};
  socklen_t size = sizeof info;
  return getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? std::optional(info) : std::nullopt;
}

}  // namespace

std::uint64_t acknowledged_bytes(int socket) {
  const auto info = info_of(socket);
  return info ? info->tcpi_bytes_acked : 0;
}

bool has_left(int socket) {
  const auto info = info_of(socket);
  return !info || info->tcpi_state != kEstablished;
}

}  // namespace relievo
