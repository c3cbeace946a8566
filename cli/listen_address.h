// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"

namespace relievo {

struct ListenAddress {
  std::string host;
  std::uint16_t port = 0;  // 0: any free one
};

/// "127.0.0.1:8080", "[::1]:8080" or ":8080" (every interface).
Result<ListenAddress> parse_listen_address(const std::string& text);

/// What to type into a browser on this machine: "http://127.0.0.1:8080/", "https://127.0.0.1:8080/?token=T".
std::string browser_address(const ListenAddress& address, bool https, const std::string& token);

}  // namespace relievo
