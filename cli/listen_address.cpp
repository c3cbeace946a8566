// SPDX-License-Identifier: Apache-2.0
#include "cli/listen_address.h"

#include <charconv>
#include <system_error>

namespace relievo {

Result<ListenAddress> parse_listen_address(const std::string& text) {
  const Error wrong{"'" + text + "' is no HOST:PORT, for example 127.0.0.1:8080 or [::1]:8080"};
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) return wrong;
  ListenAddress out;
  out.host = text.substr(0, colon);
  if (out.host.size() > 2 && out.host.front() == '[' && out.host.back() == ']') {
    out.host = out.host.substr(1, out.host.size() - 2);
  } else if (out.host.find_first_of(":[]") != std::string::npos) {
    return wrong;
  }
  const char* end = text.data() + text.size();
  const auto [rest, failed] = std::from_chars(text.data() + colon + 1, end, out.port);
  if (failed != std::errc() || rest != end) return wrong;
  return out;
}

std::string browser_address(const ListenAddress& address, bool https, const std::string& token) {
  std::string host = address.host;
  if (host.empty() || host == "0.0.0.0") host = "127.0.0.1";
  if (host == "::") host = "::1";
  if (host.find(':') != std::string::npos) host = '[' + host + ']';
  return (https ? "https://" : "http://") + host + ':' + std::to_string(address.port) + '/' +
         (token.empty() ? "" : "?token=" + token);
}

}  // namespace relievo
