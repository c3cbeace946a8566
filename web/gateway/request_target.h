// SPDX-License-Identifier: Apache-2.0
// Where a request goes: its target and its Host together (RFC 9112, 3.2). Pure.
#pragma once

#include <optional>
#include <string_view>

namespace relievo {

struct RequestTarget {
  std::string_view host;  // "name", "name:port", "[v6]:port"; may be empty
  std::string_view path;  // "/api/streams?x"; or what is none, as "*"
};

/// "name", "name:port", "[v6]" or "[v6]:port", as far as characters say; also without a name.
bool valid_host(std::string_view host);

/// The name in an absolute target ("http://name/path") goes before `host`. Nothing where either is none.
/// Points into both.
std::optional<RequestTarget> request_target(std::string_view target, std::string_view host);

}  // namespace relievo
