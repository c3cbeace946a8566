// SPDX-License-Identifier: Apache-2.0
#include "web/gateway/request_target.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <system_error>

namespace relievo {
namespace {

bool all_of(std::string_view text, std::string_view also, int (*kind)(int)) {
  return std::all_of(text.begin(), text.end(), [&](char c) {
    return kind(static_cast<unsigned char>(c)) != 0 || also.find(c) != std::string_view::npos;
  });
}

/// What "%2C" at `text`'s start stands for.
std::optional<char> escape_in(std::string_view text) {
  unsigned byte = 0;
  const std::string_view digits = text.starts_with('%') ? text.substr(1, 2) : std::string_view();
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), byte, 16);
  if (digits.size() != 2 || error != std::errc() || end != digits.data() + 2) return std::nullopt;
  return static_cast<char>(byte);
}

}  // namespace

bool begins_with(std::string_view text, std::string_view lower_case) {
  return text.size() >= lower_case.size() &&
         std::equal(lower_case.begin(), lower_case.end(), text.begin(),
                    [](char known, char c) { return std::tolower(static_cast<unsigned char>(c)) == known; });
}

std::string_view query_of(std::string_view target) {
  const auto mark = target.find('?');
  return mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
}

std::string percent_decoded(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto escaped = escape_in(text.substr(i));
    out += escaped.value_or(text[i] == '+' ? ' ' : text[i]);
    if (escaped) i += 2;
  }
  return out;
}

std::string unescaped(std::string_view path) {
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const auto escaped = escape_in(path.substr(i));
    const bool is_plain = escaped && all_of(std::string_view(&*escaped, 1), "-._~", std::isalnum);
    out += is_plain ? *escaped : path[i];
    if (is_plain) i += 2;
  }
  return out;
}

bool valid_host(std::string_view host) {
  std::size_t end = std::min(host.find(':'), host.size());
  if (host.starts_with('[')) {
    end = host.find(']');
    if (end == std::string_view::npos || !all_of(host.substr(1, end - 1), ":.%", std::isxdigit)) return false;
    ++end;
  } else if (!all_of(host.substr(0, end), "-._~%!$&'()*+,;=", std::isalnum)) {
    return false;
  }
  const std::string_view port = host.substr(end);
  return port.empty() || (port.front() == ':' && all_of(port.substr(1), "", std::isdigit));
}

std::optional<RequestTarget> request_target(std::string_view target, std::string_view host) {
  RequestTarget out{host, target};
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!begins_with(target, scheme)) continue;
    const std::string_view rest = target.substr(scheme.size());
    const auto end = std::min(rest.find_first_of("/?"), rest.size());
    out = {rest.substr(0, end), end < rest.size() ? rest.substr(end) : std::string_view("/")};
    if (out.host.empty() || out.host.front() == ':') return std::nullopt;
  }
  return valid_host(host) && valid_host(out.host) ? std::optional(out) : std::nullopt;
}

}  // namespace relievo
