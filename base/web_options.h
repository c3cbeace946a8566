// SPDX-License-Identifier: Apache-2.0
// Who may use a web gateway, and how much of it: what a server and `relievo web` have in common.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace relievo {

struct WebOptions {
  std::string tls_cert, tls_key;        // PEM files, both or none: https; read again when they have changed
  std::string token_file;               // a token a line; who has one may watch
  std::optional<bool> open = {};        // anybody may watch, on whatever address. Not said: no
  std::vector<std::string> origins;     // "https://viewer.example": other sites whose pages may watch
  std::optional<int> max_clients = {};  // WebSocket clients; more are refused with 503. Not said: 64
  // Connections from one address. Not said: 32, and as many as there are places from this machine, since a
  // proxy here speaks for many.
  std::optional<int> max_per_address = {};
  std::optional<double> max_rate =
      {};  // requests a second from one address; not said: 200, and any from here

  bool operator==(const WebOptions&) const = default;
};

}  // namespace relievo
