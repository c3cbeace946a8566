// SPDX-License-Identifier: Apache-2.0
// Where a request goes: its target and its Host together (RFC 9112, 3.2). Pure.
#pragma once

#include <optional>
#include <string>
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

/// What is behind the first '?', empty where there is none.
std::string_view query_of(std::string_view target);

/// A name or a value of a query: "%2C" is a comma, '+' a space. What is no such escape stays as it is.
std::string percent_decoded(std::string_view text);

/// A part of a path without those escapes that are no different from what they stand for: "%61" is "a", but
/// "%2F" is no slash (RFC 3986, 6.2.2.2).
std::string unescaped(std::string_view path);

/// In whatever case `text` is.
bool begins_with(std::string_view text, std::string_view lower_case);

}  // namespace relievo
