// SPDX-License-Identifier: Apache-2.0
// What the system says of a TCP connection. In a file of its own, since the kernel's header for it
// and those that Asio includes exclude each other.
#pragma once

#include <cstdint>

namespace relievo {

/// How many the other end of `socket` has acknowledged since it connected; 0 where the system does not say.
std::uint64_t acknowledged_bytes(int socket);

/// Whether the other end has closed, or is lost.
bool has_left(int socket);

}  // namespace relievo
